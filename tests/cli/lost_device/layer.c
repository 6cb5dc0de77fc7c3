/* A Vulkan layer that takes the device away: the call number LOSE_AT of those below fails, and all later ones.
   Without LOSE_AT it counts them. KIND chooses the calls: `work` (submissions and waits), or `memory` (allocations, of which only this one
   fails). The number of calls is written to COUNT_TO. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void (*Fn)(void);
typedef Fn (*GetProc)(void *, const char *);
typedef struct Link { struct Link *next; GetProc instance, device; } Link;
typedef struct Info { int type; struct Info *next; int function; Link *link; } Info;
typedef struct Create { int type; Info *next; } Create;

static GetProc next_instance, next_device;
static Fn next_submit, next_wait, next_value, next_idle, next_all_idle, next_allocate;
static void *opened;
static int calls, lost;

enum { LOST = -4, NO_MEMORY = -2 };

static int is_kind(const char *kind) { const char *wanted = getenv("KIND"); return wanted && !strcmp(wanted, kind); }

/* Whether this call is the one that fails. */
static int counts(void) {
  const char *at = getenv("LOSE_AT"), *to = getenv("COUNT_TO");
  int number = __sync_add_and_fetch(&calls, 1);
  if (to) {
    FILE *file = fopen(to, "w");
    if (file) { fprintf(file, "%d", number); fclose(file); }
  }
  return at && atoi(at) == number;
}

/* A device that is lost writes to no memory any more, and its user may free it: the real device, which is not lost, is waited for. */
static int is_lost(void) {
  if (is_kind("work") && counts()) {
    lost = 1;
    ((int (*)(void *))next_all_idle)(opened);
  }
  return lost;
}

static int submit(void *queue, uint32_t count, const void *submits, void *fence) {
  return is_lost() ? LOST : ((int (*)(void *, uint32_t, const void *, void *))next_submit)(queue, count, submits, fence);
}
static int wait(void *device, const void *info, uint64_t timeout) {
  return is_lost() ? LOST : ((int (*)(void *, const void *, uint64_t))next_wait)(device, info, timeout);
}
static int value(void *device, void *semaphore, uint64_t *value) {
  return is_lost() ? LOST : ((int (*)(void *, void *, uint64_t *))next_value)(device, semaphore, value);
}
static int idle(void *queue) {
  int outcome = ((int (*)(void *))next_idle)(queue);
  return lost ? LOST : outcome;
}
static int allocate(void *device, const void *info, const void *allocator, void *memory) {
  if (is_kind("memory") && counts()) return NO_MEMORY;
  return lost ? LOST : ((int (*)(void *, const void *, const void *, void *))next_allocate)(device, info, allocator, memory);
}

static Info *layer_info(Create *create, int type) {
  Info *info = create->next;
  while (info && !(info->type == type && info->function == 0)) info = info->next;
  return info;
}

static int create_instance(Create *create, const void *allocator, void **instance) {
  Info *info = layer_info(create, 47);
  next_instance = info->link->instance;
  info->link = info->link->next;
  return ((int (*)(Create *, const void *, void **))next_instance(NULL, "vkCreateInstance"))(create, allocator, instance);
}

static int create_device(void *physical, Create *create, const void *allocator, void **device) {
  Info *info = layer_info(create, 48);
  GetProc instance = info->link->instance;
  next_device = info->link->device;
  info->link = info->link->next;
  int outcome = ((int (*)(void *, Create *, const void *, void **))instance(NULL, "vkCreateDevice"))(physical, create, allocator, device);
  if (outcome) return outcome;
  next_submit = next_device(*device, "vkQueueSubmit");
  next_wait = next_device(*device, "vkWaitSemaphores");
  if (!next_wait) next_wait = next_device(*device, "vkWaitSemaphoresKHR");
  next_value = next_device(*device, "vkGetSemaphoreCounterValue");
  if (!next_value) next_value = next_device(*device, "vkGetSemaphoreCounterValueKHR");
  next_idle = next_device(*device, "vkQueueWaitIdle");
  next_all_idle = next_device(*device, "vkDeviceWaitIdle");
  next_allocate = next_device(*device, "vkAllocateMemory");
  opened = *device;
  return 0;
}

Fn vkGetDeviceProcAddr(void *device, const char *name);

static Fn own(const char *name) {
  static const struct { const char *name; Fn fn; } all[] = {
    {"vkGetDeviceProcAddr", (Fn)vkGetDeviceProcAddr}, {"vkCreateDevice", (Fn)create_device}, {"vkQueueSubmit", (Fn)submit},
    {"vkWaitSemaphores", (Fn)wait}, {"vkWaitSemaphoresKHR", (Fn)wait}, {"vkGetSemaphoreCounterValue", (Fn)value},
    {"vkGetSemaphoreCounterValueKHR", (Fn)value}, {"vkQueueWaitIdle", (Fn)idle}, {"vkAllocateMemory", (Fn)allocate},
  };
  for (unsigned i = 0; i < sizeof all / sizeof *all; i++)
    if (!strcmp(all[i].name, name)) return all[i].fn;
  return NULL;
}

Fn vkGetDeviceProcAddr(void *device, const char *name) {
  Fn fn = own(name);
  return fn ? fn : next_device(device, name);
}

Fn vkGetInstanceProcAddr(void *instance, const char *name) {
  if (!strcmp(name, "vkGetInstanceProcAddr")) return (Fn)vkGetInstanceProcAddr;
  if (!strcmp(name, "vkCreateInstance")) return (Fn)create_instance;
  Fn fn = own(name);
  return fn ? fn : instance ? next_instance(instance, name) : NULL;
}
