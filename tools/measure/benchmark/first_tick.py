"""A process that gets ready to fly and ticks once: what `startup.first_tick_s` times from outside."""

from tools.measure.benchmark.tick import harness

if __name__ == "__main__":
    with harness() as flown:
        flown.runtime.tick()
        print("ticked", flush=True)
