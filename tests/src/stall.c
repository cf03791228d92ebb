/* For LD_PRELOAD: the first write to a regular file that begins later than STALL_AFTER_MS after the start of the program
   takes STALL_MS. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

static long begun_ms;
static int done;

static long now_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

__attribute__((constructor)) static void begin(void) { begun_ms = now_ms(); }

ssize_t write(int file, const void *bytes, size_t count) {
    ssize_t (*next)(int, const void *, size_t) = (ssize_t(*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write");
    const char *after = getenv("STALL_AFTER_MS"), *stall = getenv("STALL_MS");
    struct stat kind;
    if (!done && after && stall && now_ms() - begun_ms > atol(after) && fstat(file, &kind) == 0 && S_ISREG(kind.st_mode)) {
        done = 1;
        struct timespec pause = {atol(stall) / 1000, atol(stall) % 1000 * 1000000};
        nanosleep(&pause, 0);
    }
    return next(file, bytes, count);
}
