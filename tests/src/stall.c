/* For LD_PRELOAD: the first write to a regular file, or its first sync if STALL_CALL is fdatasync, that begins later than
   STALL_AFTER_MS after the start of the program takes STALL_MS. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>
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

static void stall(const char *call, int file) {
    const char *after = getenv("STALL_AFTER_MS"), *stall = getenv("STALL_MS"), *which = getenv("STALL_CALL");
    struct stat kind;
    if (!done && after && stall && strcmp(call, which ? which : "write") == 0 && now_ms() - begun_ms > atol(after)
        && fstat(file, &kind) == 0 && S_ISREG(kind.st_mode)) {
        done = 1;
        struct timespec pause = {atol(stall) / 1000, atol(stall) % 1000 * 1000000};
        nanosleep(&pause, 0);
    }
}

ssize_t write(int file, const void *bytes, size_t count) {
    stall("write", file);
    return ((ssize_t(*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write"))(file, bytes, count);
}

int fdatasync(int file) {
    stall("fdatasync", file);
    return ((int (*)(int))dlsym(RTLD_NEXT, "fdatasync"))(file);
}
