// SPDX-License-Identifier: Apache-2.0
#include "system/sandbox.hpp"

#include <cerrno>
#include <cstring>
#include <grp.h>
#include <pwd.h>
#include <sched.h>
#include <stdexcept>
#include <sys/capability.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <seccomp.h>

#include "base/log.hpp"

namespace gw {

namespace {

// Everything the daemon does after start, reopening of sources and writing of records included. No exec, no fork, no ptrace, no mount.
const char* const kAllowed[] = {
    "accept4", "access", "bind", "brk", "clock_gettime", "clock_nanosleep", "clone", "clone3", "close", "connect", "epoll_create1", "epoll_ctl",
    "epoll_pwait", "epoll_wait", "eventfd2", "exit", "exit_group", "faccessat", "faccessat2", "fchmod", "fcntl", "fdatasync", "flock", "fstat", "fsync", "ftruncate",
    "futex", "get_robust_list", "getcwd", "getdents64", "getegid", "geteuid", "getgid", "getpeername", "getpid", "getrandom", "getsockname", "getsockopt",
    "gettid", "gettimeofday", "getuid", "ioctl", "listen", "lseek", "lstat", "madvise", "membarrier", "mmap", "mprotect", "mremap", "munmap", "nanosleep",
    "newfstatat", "open", "openat", "pipe2", "poll", "ppoll", "prctl", "pread64", "prlimit64", "pselect6", "pwrite64", "read", "readlink", "readv",
    "recvfrom", "recvmmsg", "recvmsg", "rename", "renameat", "renameat2", "restart_syscall", "rseq", "rt_sigaction", "rt_sigprocmask", "rt_sigreturn",
    "sched_getaffinity", "sched_yield", "select", "sendmmsg", "sendmsg", "sendto", "set_robust_list", "set_tid_address", "setsockopt", "shutdown",
    "sigaltstack", "signalfd4", "socket", "stat", "statx", "sysinfo", "tgkill", "time", "timerfd_create", "timerfd_settime", "umask", "chmod", "chown", "fchownat",
    "fchmodat", "uname", "unlink", "unlinkat", "write", "writev",
};

[[noreturn]] void fail(const std::string& what, const char* mend) { throw std::runtime_error(what + ": " + strerror(errno) + "; " + mend); }

}  // namespace

// Later allocations are locked too, when the capability that passes over the limit is gone: the limit itself must allow them.
static void lock_memory() {
    const rlimit none{RLIM_INFINITY, RLIM_INFINITY};
    setrlimit(RLIMIT_MEMLOCK, &none);
    rlimit now{};
    errno = ENOMEM;
    if (getrlimit(RLIMIT_MEMLOCK, &now) < 0 || now.rlim_cur != RLIM_INFINITY || mlockall(MCL_CURRENT | MCL_FUTURE) < 0)
        fail("system.lock_memory", "allow it (LimitMEMLOCK=infinity) or set it to false");
}

void set_scheduling(const SystemConfig& c) {
    if (c.lock_memory) lock_memory();
    if (c.realtime_priority == 0) return;
    sched_param p{};
    p.sched_priority = int(c.realtime_priority);
    if (sched_setscheduler(0, SCHED_FIFO, &p) < 0) fail("system.realtime_priority", "allow it (CAP_SYS_NICE, LimitRTPRIO) or set it to 0");
}

void drop_privileges(const std::string& user) {
    if (!user.empty()) {
        const passwd* p = getpwnam(user.c_str());
        if (!p) throw std::runtime_error("security.user: there is no user \"" + user + "\"; create it or mend the name");
        if (geteuid() != p->pw_uid) {
            if (geteuid() != 0) throw std::runtime_error("security.user: only root can become \"" + user + "\"; start as root or as that user");
            if (initgroups(user.c_str(), p->pw_gid) < 0 || setgid(p->pw_gid) < 0 || setuid(p->pw_uid) < 0) fail("security.user", "start as root");
        }
    }
    prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
    cap_t none = cap_init();
    const int rc = none ? cap_set_proc(none) : -1;
    cap_free(none);
    if (rc < 0) fail("dropping capabilities", "report this");
}

void restrict_system_calls(const std::string& mode) {
    if (mode == "off") return;
    scmp_filter_ctx filter = seccomp_init(mode == "log" ? SCMP_ACT_LOG : SCMP_ACT_KILL_PROCESS);
    if (!filter) throw std::runtime_error("security.seccomp: out of memory");
    for (const char* name : kAllowed) {
        const int number = seccomp_syscall_resolve_name(name);
        if (number != __NR_SCMP_ERROR) seccomp_rule_add(filter, SCMP_ACT_ALLOW, number, 0);
    }
    seccomp_attr_set(filter, SCMP_FLTATR_CTL_TSYNC, 1);
    const int rc = seccomp_load(filter);
    seccomp_release(filter);
    if (rc < 0) log_event(Level::warning, "sandbox", "seccomp", "use a kernel with seccomp, or set security.seccomp = \"off\"", "system-call filter not loaded: %s", strerror(-rc));
}

}  // namespace gw
