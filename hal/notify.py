"""What systemd wants to hear of a service (sd_notify): datagrams to the socket that NOTIFY_SOCKET names."""

import os
import socket


def notify(message: str) -> bool:
    """Send READY=1, WATCHDOG=1, STATUS=... ; False where nobody listens."""
    path = os.environ.get("NOTIFY_SOCKET", "")
    if path[:1] not in ("/", "@"):
        return False
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as line:
            line.setblocking(False)
            line.sendto(message.encode(), path.replace("@", "\0", 1) if path[0] == "@" else path)
    except OSError:
        return False
    return True
