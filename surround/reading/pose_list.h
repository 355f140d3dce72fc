// Lists of times with files or poses, as the TUM RGB-D layout has them: "seconds file" and
// "seconds tx ty tz qx qy qz qw", # comments. Also "name number tx …" for views without a time.
#pragma once
#include "base/geometry.h"

struct timed_pose {
    int64_t time_ns; // 0 in a list of views without times
    char name[64];   // "0007" by its place in the list, or "NAME/NUMBER"
    struct pose pose;
};
struct timed_file {
    int64_t time_ns;
    char path[1024]; // with the folder
};

// *out is malloc'ed, the caller frees it; on failure untouched. ERR_INPUT: a line is no pose or file, not finite, times
// do not rise or are beyond 4e9 seconds, a file lies outside of the folder, or the list is empty. ERR_MISSING, ERR_IO,
// ERR_MEMORY.
MUST_CHECK enum status pose_list_read(const char *path, struct timed_pose **out, int *count);
MUST_CHECK enum status file_list_read(const char *folder, const char *name, struct timed_file **out, int *count);

// The pose at a time: between two by slerp, outside the first or last.
struct pose pose_list_at(const struct timed_pose *list, int count, int64_t time_ns);
