"""What a process takes of its computer: the one reader of /proc/PID; zeros where the system does not say."""

import os


def _read(pid: int | str, name: str) -> str:
    try:
        with open(f"/proc/{pid}/{name}") as file:
            return file.read()
    except OSError:
        return ""


def resident_bytes(pid: int | str = "self") -> int:
    """Resident memory of a process."""
    words = _read(pid, "statm").split()
    return int(words[1]) * os.sysconf("SC_PAGE_SIZE") if words else 0


def peak_resident_bytes() -> int:
    """Largest resident memory of this process so far. (getrusage has that of the program it was started by, too.)"""
    _, _, behind = _read("self", "status").partition("VmHWM:")
    return int(behind.split()[0]) * 1024 if behind else 0


def open_files() -> int:
    """Descriptors that this process has open."""
    try:
        return len(os.listdir("/proc/self/fd"))
    except OSError:
        return 0
