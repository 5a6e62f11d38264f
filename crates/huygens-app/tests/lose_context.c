/* Stands before the loader of OpenGL's functions (LD_PRELOAD): glGetError tells, once, that the context is lost when the
   file that LOSE_CONTEXT names is there, and takes the file away. No driver loses one on demand. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CONTEXT_LOST 0x0507

typedef void (*function)(void);
typedef function (*loader)(const char *name);
typedef unsigned (*get_error)(void);

static loader next_loader;
static get_error next_get_error;

static unsigned lost_or_error(void) {
  const char *file = getenv("LOSE_CONTEXT");
  if (file && unlink(file) == 0) return CONTEXT_LOST;
  return next_get_error();
}

static function load(const char *name) {
  function found = next_loader(name);
  if (strcmp(name, "glGetError") != 0) return found;
  next_get_error = (get_error)found;
  return (function)lost_or_error;
}

void *dlsym(void *library, const char *name) {
  static void *(*next)(void *, const char *);
  const char *versions[] = {"GLIBC_2.34", "GLIBC_2.17", "GLIBC_2.2.5"};
  for (int i = 0; i < 3 && !next; i++) *(void **)&next = dlvsym(RTLD_NEXT, "dlsym", versions[i]);
  void *found = next ? next(library, name) : NULL;
  if (!found || (strcmp(name, "glXGetProcAddress") != 0 && strcmp(name, "eglGetProcAddress") != 0)) return found;
  *(void **)&next_loader = found;
  return (void *)load;
}
