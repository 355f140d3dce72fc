// The calls by which v4l2.c reaches the kernel, so that a test can stand in for it with the kernel's own structs. For
// platform/ and tests only.
#pragma once
#include <poll.h>
#include <stddef.h>
#include <sys/types.h>

struct v4l2_system {
    int (*open_node)(int number); // /dev/videoNUMBER; -1 and errno
    int (*control)(int file, unsigned long request, void *argument);
    void *(*map)(size_t bytes, int file, off_t at); // shared, to read; MAP_FAILED
    int (*unmap)(void *at, size_t bytes);
    int (*wait)(struct pollfd *files, nfds_t count, int ms);
    int (*close_node)(int file);
    const char *class_folder; // /sys/class/video4linux
};

// NULL: the kernel's own, which it is at first. Borrowed.
void v4l2_use_system(const struct v4l2_system *system);
