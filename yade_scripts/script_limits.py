"""What a user's script may take: memory, and room for what it says or writes; no network."""

import ctypes
import mmap
import os
import resource
import signal
import struct
import sys
import time
from os import _exit  # while a script runs, os._exit is another


class Limits:
    """Around a script: `memory` [GB] that it may allocate beside what the process has, and `output` [MB] that it may print, and
    write into one file. More memory is a MemoryError, more in a file an OSError; of what it prints the rest is left out."""

    def __init__(self, memory, output):
        self.memory, self.output = int(memory * 2**30), int(output * 2**20)

    def __enter__(self):
        self._before = {r: resource.getrlimit(r) for r in (resource.RLIMIT_AS, resource.RLIMIT_FSIZE)}
        self._lower(resource.RLIMIT_AS, _address_space() + self.memory)
        self._lower(resource.RLIMIT_FSIZE, self.output)
        self._cut_output()
        return self

    def __exit__(self, *error):
        for what, before in self._before.items():
            resource.setrlimit(what, before)
        sys.stdout.flush()
        sys.stderr.flush()
        for number, kept in zip((1, 2), self._kept):
            os.dup2(kept, number)
            os.close(kept)
        until = time.monotonic() + 1  # what the script has started may hold the pipe for longer
        while os.waitpid(self._reader, os.WNOHANG) == (0, 0) and time.monotonic() < until:
            time.sleep(0.002)

    def said_too_much(self):
        """Bytes that were left out of what the script printed."""
        return max(0, struct.unpack("q", self._count[:8])[0] - self.output)

    @staticmethod
    def _lower(what, most):
        hard = resource.getrlimit(what)[1]
        resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))

    def _cut_output(self):
        """Standard output and error go through a process that passes on the first `output` bytes."""
        sys.stdout.flush()
        sys.stderr.flush()
        self._count = mmap.mmap(-1, mmap.PAGESIZE)  # of bytes, shared
        ours, theirs = os.pipe()
        self._reader = os.fork()
        if self._reader == 0:
            os.close(theirs)
            self._pass_on(ours)
        os.close(ours)
        self._kept = [os.dup(1), os.dup(2)]
        for number in (1, 2):
            os.dup2(theirs, number)
        os.close(theirs)

    def _pass_on(self, pipe):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        done = 0
        try:
            while said := os.read(pipe, 1 << 16):
                os.write(1, said[: max(0, self.output - done)])
                done += len(said)
                self._count[:8] = struct.pack("q", done)
        finally:
            _exit(0)


def cut_off_network():
    """From now on this thread, and what it starts, sees no network, as in `unshare --net`; whether the system allows that. Who
    is not root becomes itself in a user namespace of its own."""
    new_user, new_net = 0x10000000, 0x40000000  # of sched.h
    unshare = ctypes.CDLL(None, use_errno=True).unshare
    if unshare(new_net) == 0:
        return True
    user, group = os.geteuid(), os.getegid()
    if unshare(new_user | new_net) != 0:
        return False
    for name, text in (("setgroups", "deny"), ("uid_map", f"{user} {user} 1"), ("gid_map", f"{group} {group} 1")):
        with open(f"/proc/self/{name}", "w") as file:
            file.write(text)
    return True


def _address_space():
    """Of this process [byte]."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[0]) * resource.getpagesize()
