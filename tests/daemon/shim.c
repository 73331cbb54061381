/* SPDX-License-Identifier: Apache-2.0 */
/* Preloaded into driveidd under test.
 *   DRIVEID_SHIM_COUNT=FILE  a file of 8 bytes that holds the number of allocations of the whole process
 *   DRIVEID_SHIM_DEAF=1      the hello to an slcan adapter fails
 *   DRIVEID_SHIM_RS485=FILE  a serial port takes RS-485 mode, and the flags that it is given are written here
 *   DRIVEID_SHIM_KILL=N      the process kills itself before the N-th step of writing the state file; a write is cut in half */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

void *__libc_malloc(size_t);
void *__libc_calloc(size_t, size_t);
void *__libc_realloc(void *, size_t);
void *__libc_memalign(size_t, size_t);

static _Atomic unsigned long *counter;
static long kill_at, step;
static int state_fd = -1, deaf;

__attribute__((constructor)) static void begin(void) {
    const char *file = getenv("DRIVEID_SHIM_COUNT"), *at = getenv("DRIVEID_SHIM_KILL");
    const int fd = file ? open(file, O_RDWR | O_CLOEXEC) : -1;
    void *p = fd >= 0 ? mmap(NULL, 8, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0) : MAP_FAILED;
    if (p != MAP_FAILED) counter = p;
    if (fd >= 0) close(fd);
    kill_at = at ? atol(at) : 0;
    deaf = getenv("DRIVEID_SHIM_DEAF") != NULL;
}

static void counted(void) {
    if (counter) atomic_fetch_add(counter, 1);
}

void *malloc(size_t n) { return counted(), __libc_malloc(n); }
void *calloc(size_t n, size_t each) { return counted(), __libc_calloc(n, each); }
void *realloc(void *p, size_t n) { return counted(), __libc_realloc(p, n); }
void *memalign(size_t to, size_t n) { return counted(), __libc_memalign(to, n); }
void *aligned_alloc(size_t to, size_t n) { return counted(), __libc_memalign(to, n); }

/* 1: this is the step to die at. */
static int due(void) { return kill_at > 0 && ++step == kill_at; }
static void die(void) { kill(getpid(), SIGKILL); }
static int of_state(const char *path) {
    const char *name = strrchr(path, '/');
    return kill_at > 0 && ((name && strncmp(name, "/state", 6) == 0) || strcmp(path, "state") == 0);
}

int open(const char *path, int flags, ...) {
    static int (*real)(const char *, int, ...);
    va_list more;
    va_start(more, flags);
    const mode_t mode = flags & O_CREAT ? va_arg(more, mode_t) : 0;
    va_end(more);
    if (!real) real = (int (*)(const char *, int, ...))dlsym(RTLD_NEXT, "open");
    const int mine = of_state(path) && flags & (O_CREAT | O_DIRECTORY);
    if (mine && due()) die();
    const int fd = real(path, flags, mode);
    if (mine) state_fd = fd;
    return fd;
}

ssize_t write(int fd, const void *data, size_t n) {
    static ssize_t (*real)(int, const void *, size_t);
    if (!real) real = (ssize_t(*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write");
    if (deaf && n == 7 && memcmp(data, "C\rS", 3) == 0) return errno = EIO, -1;
    if (kill_at > 0 && fd == state_fd && due()) {
        (void)!real(fd, data, n / 2);
        die();
    }
    return real(fd, data, n);
}

int ioctl(int fd, unsigned long request, ...) {
    static int (*real)(int, unsigned long, ...);
    const char *file = request == TIOCSRS485 || request == TIOCGRS485 ? getenv("DRIVEID_SHIM_RS485") : NULL;
    va_list more;
    va_start(more, request);
    void *argument = va_arg(more, void *);
    va_end(more);
    if (!real) real = (int (*)(int, unsigned long, ...))dlsym(RTLD_NEXT, "ioctl");
    if (!file) return real(fd, request, argument);
    if (request == TIOCGRS485) return memset(argument, 0, sizeof(struct serial_rs485)), 0;
    const int out = open(file, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    (void)!write(out, &((struct serial_rs485 *)argument)->flags, 4);
    return close(out);
}

int fsync(int fd) {
    static int (*real)(int);
    if (!real) real = (int (*)(int))dlsym(RTLD_NEXT, "fsync");
    if (fd == state_fd && due()) die();
    return real(fd);
}

int rename(const char *from, const char *to) {
    static int (*real)(const char *, const char *);
    if (!real) real = (int (*)(const char *, const char *))dlsym(RTLD_NEXT, "rename");
    if (of_state(to) && due()) die();
    return real(from, to);
}
