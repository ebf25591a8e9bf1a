/* Faults at chosen system calls, for run.py: cc -shared -fPIC -o interpose.so interpose.c -ldl; LD_PRELOAD=interpose.so

   FAULT_PROGRAM  femxdem or femxdem-worker: in which process
   FAULT_FILE     part of a file's name: its calls count
   FAULT_AT       the call at which it strikes, from 1
   FAULT_DO       ENOSPC, EIO, EROFS: this call and all later ones fail so; KILL: SIGKILL before the call; TEAR: SIGKILL
                  after half of what it was to write
   FAULT_COUNT    a file: the number of calls is written there at the end, for choosing FAULT_AT
   FAULT_FORK     from this call on fork fails with ENOMEM
   FAULT_CLOCK    seconds by which the clock of the day is set back after FAULT_AT readings of it */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

static int active, calls, forks, readings, at, fork_at, reason, kills, tears;
static long back;
static const char *file, *count;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

__attribute__((constructor)) static void begin(void) {
  const char *program = getenv("FAULT_PROGRAM"), *what = getenv("FAULT_DO");
  char self[4096] = "";
  if (program == NULL || readlink("/proc/self/exe", self, sizeof self - 1) < 0) return;
  const char *name = strrchr(self, '/');
  active = name != NULL && strcmp(name + 1, program) == 0;
  file = getenv("FAULT_FILE");
  count = getenv("FAULT_COUNT");
  at = getenv("FAULT_AT") ? atoi(getenv("FAULT_AT")) : 0;
  fork_at = getenv("FAULT_FORK") ? atoi(getenv("FAULT_FORK")) : 0;
  back = getenv("FAULT_CLOCK") ? atol(getenv("FAULT_CLOCK")) : 0;
  if (what == NULL) return;
  reason = !strcmp(what, "ENOSPC") ? ENOSPC : !strcmp(what, "EIO") ? EIO : !strcmp(what, "EROFS") ? EROFS : 0;
  kills = !strcmp(what, "KILL");
  tears = !strcmp(what, "TEAR");
}

__attribute__((destructor)) static void end(void) {
  if (!active || count == NULL) return;
  FILE *out = fopen(count, "w");
  if (out == NULL) return;
  fprintf(out, "%d\n", calls);
  fclose(out);
}

static void die(void) { kill(getpid(), SIGKILL); }

/* 1: this call is to fail, errno is set; 2: it is to be torn. */
static int strikes(const char *name) {
  if (!active || file == NULL || name == NULL || strstr(name, file) == NULL) return 0;
  ++calls;
  if (at == 0 || calls < at) return 0;
  if (kills) die();
  if (tears) return 2;
  errno = reason;
  return reason != 0;
}

static int strikes_descriptor(int descriptor) {
  char link[64], name[4096] = "";
  if (!active || file == NULL) return 0;
  snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  return readlink(link, name, sizeof name - 1) > 0 ? strikes(name) : 0;
}

ssize_t write(int descriptor, const void *bytes, size_t size) {
  const int now = strikes_descriptor(descriptor);
  if (now == 1) return -1;
  const ssize_t done = REAL(write)(descriptor, bytes, now == 2 ? size / 2 : size);
  if (now == 2) die();
  return done;
}

ssize_t pwrite(int descriptor, const void *bytes, size_t size, off_t place) {
  const int now = strikes_descriptor(descriptor);
  if (now == 1) return -1;
  const ssize_t done = REAL(pwrite)(descriptor, bytes, now == 2 ? size / 2 : size, place);
  if (now == 2) die();
  return done;
}
ssize_t pwrite64(int descriptor, const void *bytes, size_t size, off64_t place) { return pwrite(descriptor, bytes, size, place); }

int fallocate(int descriptor, int mode, off_t place, off_t size) {
  return strikes_descriptor(descriptor) ? -1 : REAL(fallocate)(descriptor, mode, place, size);
}
int fallocate64(int descriptor, int mode, off64_t place, off64_t size) { return fallocate(descriptor, mode, place, size); }
int fsync(int descriptor) { return strikes_descriptor(descriptor) ? -1 : REAL(fsync)(descriptor); }
int rename(const char *from, const char *to) { return strikes(to) ? -1 : REAL(rename)(from, to); }
int mkostemp(char *name, int flags) { return strikes(name) ? -1 : REAL(mkostemp)(name, flags); }

int open(const char *name, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  if ((flags & O_ACCMODE) != O_RDONLY && strikes(name)) return -1;
  return REAL(open)(name, flags, mode);
}
int open64(const char *name, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return open(name, flags, mode);
}

pid_t fork(void) {
  if (active && fork_at > 0 && ++forks >= fork_at) {
    errno = ENOMEM;
    return -1;
  }
  return REAL(fork)();
}

/* Seconds by which the clock of the day is behind. */
static long behind(void) { return active && back > 0 && ++readings > at ? back : 0; }

int clock_gettime(clockid_t which, struct timespec *now) {
  const int done = REAL(clock_gettime)(which, now);
  if (which == CLOCK_REALTIME && done == 0) now->tv_sec -= behind();
  return done;
}
int gettimeofday(struct timeval *restrict now, void *restrict zone) {
  const int done = REAL(gettimeofday)(now, zone);
  now->tv_sec -= behind();
  return done;
}
time_t time(time_t *now) {
  const time_t seconds = REAL(time)(NULL) - behind();
  if (now != NULL) *now = seconds;
  return seconds;
}
