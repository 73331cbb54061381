# SPDX-License-Identifier: Apache-2.0
"""Run a command whose ptrace(PTRACE_GETREGSET, NT_X86_XSTATE) fails with EINVAL.

User-mode-linux 6.1 keeps a fixed number of bytes for a task's vector registers. On processors with AMX the kernel's
register set is larger, is refused when written back, and the machine dies at its first process. With this filter it
finds no such set and keeps the SSE registers only, so programs inside must not use AVX (tools/vcan/init sees to it).
"""
import ctypes
import os
import struct
import sys

AUDIT_ARCH_X86_64, SYS_PTRACE, PTRACE_GETREGSET, NT_X86_XSTATE = 0xC000003E, 101, 0x4204, 0x202
PR_SET_SECCOMP, SECCOMP_MODE_FILTER, PR_SET_NO_NEW_PRIVS = 22, 2, 38
RET_ALLOW, RET_EINVAL = 0x7FFF0000, 0x00050000 | 22
# struct seccomp_data: int nr at 0, arch at 4, args[0] (request) at 16, args[2] (register set) at 32.


def load(offset):
    return struct.pack("HBBI", 0x20, 0, 0, offset)


def unless(value, skip):
    """Go on where the loaded word is value, else skip so many instructions."""
    return struct.pack("HBBI", 0x15, 0, skip, value)


def give(verdict):
    return struct.pack("HBBI", 0x06, 0, 0, verdict)


class Program(ctypes.Structure):
    _fields_ = [("length", ctypes.c_ushort), ("filter", ctypes.c_void_p)]


def main():
    code = b"".join([load(4), unless(AUDIT_ARCH_X86_64, 7), load(0), unless(SYS_PTRACE, 5), load(16),
                     unless(PTRACE_GETREGSET, 3), load(32), unless(NT_X86_XSTATE, 1), give(RET_EINVAL), give(RET_ALLOW)])
    text = ctypes.create_string_buffer(code, len(code))
    program = Program(len(code) // 8, ctypes.addressof(text))
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) or libc.prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, ctypes.byref(program)):
        sys.exit(f"without_xstate: prctl: {os.strerror(ctypes.get_errno())}")
    os.execvp(sys.argv[1], sys.argv[1:])


main()
