"""``python flood.py COUNT HOST:PORT ...``: as many connections as fast as they go, with junk where one is answered.

Prints how many were begun and let in, in how many seconds. Needs nothing of the project: it is a stranger.
"""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import time


def main(count: int, targets: list[tuple[str, int]]) -> None:
    begun, let_in = time.monotonic(), 0
    waiting: list[socket.socket] = []
    for n in range(count):
        stranger = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        stranger.setblocking(False)
        stranger.connect_ex(targets[n % len(targets)])
        waiting.append(stranger)
        if len(waiting) == 500 or n == count - 1:
            time.sleep(0.01)
            for one in waiting:
                with contextlib.suppress(OSError):
                    one.send(os.urandom(64))
                    let_in += 1
                one.close()
            waiting.clear()
    print(count, let_in, f"{time.monotonic() - begun:.1f}")


if __name__ == "__main__":
    addresses = [address.rpartition(":") for address in sys.argv[2:]]
    main(int(sys.argv[1]), [(host, int(port)) for host, _, port in addresses])
