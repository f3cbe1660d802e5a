/* Preloaded before the C library: makes the n-th call below a folder fail, whoever makes it.

   Python's own writes, and those of libraries in C++ or Rust, all go through these functions. Nothing fails
   until `shim_arm(root, n, stays_full)` is called; `shim_calls()` says how many there were since. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/uio.h>
#include <unistd.h>

static char root[PATH_MAX];
static long fail_at, calls;
static int stays_full;

void shim_arm(const char *folder, long n, int full) {
    snprintf(root, sizeof root, "%s/", folder);
    fail_at = n; stays_full = full; __atomic_store_n(&calls, 0, __ATOMIC_SEQ_CST);
}
long shim_calls(void) { return __atomic_load_n(&calls, __ATOMIC_SEQ_CST); }

static int below(const char *path) { return root[0] && strncmp(path, root, strlen(root)) == 0; }

static int fd_below(int fd) {
    char link[64], path[PATH_MAX];
    if (!root[0]) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t size = readlink(link, path, sizeof path - 2);
    if (size < 0) return 0;
    path[size] = '/'; path[size + 1] = 0;
    return below(path);
}

static int at_below(int folder, const char *path) {
    return path[0] == '/' || folder == AT_FDCWD ? below(path) : fd_below(folder);
}

/* Whether this call is to fail; `space`: whether it is one that a full disk refuses. */
static int refused(int space, int number) {
    long now = __atomic_add_fetch(&calls, 1, __ATOMIC_SEQ_CST);
    if (now == fail_at) { errno = number; return 1; }
    if (stays_full && space && fail_at && now > fail_at) { errno = ENOSPC; return 1; }
    return 0;
}

#define REAL(name, type, ...) \
    static type (*real)(__VA_ARGS__); \
    if (!real) real = (type (*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name)
#define MODE \
    mode_t mode = 0; \
    if (flags & (O_CREAT | __O_TMPFILE)) { va_list rest; va_start(rest, flags); mode = va_arg(rest, mode_t); va_end(rest); }

#define OPEN(name) int name(const char *path, int flags, ...) { REAL(name, int, const char *, int, ...); MODE \
    return below(path) && refused(flags & O_CREAT, ENOSPC) ? -1 : real(path, flags, mode); }
#define OPENAT(name) int name(int folder, const char *path, int flags, ...) { REAL(name, int, int, const char *, int, ...); MODE \
    return at_below(folder, path) && refused(flags & O_CREAT, ENOSPC) ? -1 : real(folder, path, flags, mode); }
OPEN(open) OPEN(open64) OPENAT(openat) OPENAT(openat64)

#define WRITE(name, number, arguments, call) ssize_t name arguments { REAL(name, ssize_t, WRITE_TYPES); \
    return fd_below(fd) && refused(1, number) ? -1 : real call; }
#define WRITE_TYPES int, const void *, size_t
WRITE(write, ENOSPC, (int fd, const void *bytes, size_t size), (fd, bytes, size))
#undef WRITE_TYPES
#define WRITE_TYPES int, const void *, size_t, off_t
WRITE(pwrite, ENOSPC, (int fd, const void *bytes, size_t size, off_t at), (fd, bytes, size, at))
WRITE(pwrite64, ENOSPC, (int fd, const void *bytes, size_t size, off_t at), (fd, bytes, size, at))
#undef WRITE_TYPES
#define WRITE_TYPES int, const struct iovec *, int
WRITE(writev, ENOSPC, (int fd, const struct iovec *parts, int count), (fd, parts, count))

#define SYNC(name) int name(int fd) { REAL(name, int, int); return fd_below(fd) && refused(1, EIO) ? -1 : real(fd); }
SYNC(fsync) SYNC(fdatasync)
int ftruncate64(int fd, off_t size) {
    REAL(ftruncate64, int, int, off_t);
    return fd_below(fd) && refused(1, ENOSPC) ? -1 : real(fd, size);
}

int mkdir(const char *path, mode_t mode) {
    REAL(mkdir, int, const char *, mode_t);
    return below(path) && refused(1, ENOSPC) ? -1 : real(path, mode);
}
int mkdirat(int folder, const char *path, mode_t mode) {
    REAL(mkdirat, int, int, const char *, mode_t);
    return at_below(folder, path) && refused(1, ENOSPC) ? -1 : real(folder, path, mode);
}
int rename(const char *from, const char *to) {
    REAL(rename, int, const char *, const char *);
    return below(to) && refused(1, ENOSPC) ? -1 : real(from, to);
}
int renameat(int a, const char *from, int b, const char *to) {
    REAL(renameat, int, int, const char *, int, const char *);
    return at_below(b, to) && refused(1, ENOSPC) ? -1 : real(a, from, b, to);
}
int renameat2(int a, const char *from, int b, const char *to, unsigned flags) {
    REAL(renameat2, int, int, const char *, int, const char *, unsigned);
    return at_below(b, to) && refused(1, EIO) ? -1 : real(a, from, b, to, flags);
}
int unlink(const char *path) {
    REAL(unlink, int, const char *);
    return below(path) && refused(0, EIO) ? -1 : real(path);
}
int unlinkat(int folder, const char *path, int flags) {
    REAL(unlinkat, int, int, const char *, int);
    return at_below(folder, path) && refused(0, EIO) ? -1 : real(folder, path, flags);
}
int rmdir(const char *path) {
    REAL(rmdir, int, const char *);
    return below(path) && refused(0, EIO) ? -1 : real(path);
}
