#include "reenact/avatar/tsdf_store.h"

#include "reenact/avatar/tsdf_internal.h"

#include <stdlib.h>

// Beyond anything that is measured of a person, and small enough that sums cannot overflow; chosen by hand.
static const double LEAST_STEP_M = 1e-4, MOST_M = 100;
static const float MOST_DISTANCE_M = 100, MOST_WEIGHT = 1e9F;

// Grid points without a value come in long runs: their number, then the number of those with one, and those.
static void voxels_archive(struct archive *a, struct tsdf_voxel *voxels, int32_t count)
{
    for (int32_t i = 0; i < count && !a->failed;) {
        int32_t none = 0, some = 0;
        for (; !a->reading && i + none < count && !(voxels[i + none].weight > 0);)
            none++;
        for (; !a->reading && i + none + some < count && voxels[i + none + some].weight > 0;)
            some++;
        ARCHIVE(a, none);
        ARCHIVE(a, some);
        a->failed |= none < 0 || some < 0 || none > count - i || some > count - i - none || (!none && !some);
        if (a->failed)
            break;
        archive_bytes(a, voxels + i + none, (size_t)some * sizeof *voxels);
        i += none + some;
    }
}

// Every number is finite and one that a person's can be; false for what is not a number.
static bool numbers_are_sound(const struct tsdf *t, int32_t points)
{
    const struct vec3 c = t->corner;
    bool sound = fabs(c.x) <= MOST_M && fabs(c.y) <= MOST_M && fabs(c.z) <= MOST_M && t->step >= LEAST_STEP_M &&
                 t->step <= MOST_M;
    for (int32_t i = 0; i < points; i++) {
        const struct tsdf_voxel *v = &t->voxels[i];
        sound &=
            fabsf(v->distance) <= MOST_DISTANCE_M && fabsf(v->weight) <= MOST_WEIGHT && fabsf(v->seen) <= MOST_WEIGHT;
    }
    return sound;
}

void tsdf_archive(struct archive *a, struct tsdf **v, const struct tsdf_of *of)
{
    struct tsdf *t = *v;
    if (a->reading)
        t = *v = calloc(1, sizeof *t);
    if (!t) {
        a->failed = a->out_of_memory = true;
        return;
    }
    ARCHIVE(a, t->corner);
    ARCHIVE(a, t->step);
    ARCHIVE(a, t->size);
    const double points = (double)t->size[0] * t->size[1] * t->size[2];
    a->failed |= !(t->size[0] > 0 && t->size[1] > 0 && t->size[2] > 0 && points <= TSDF_POINTS_MOST);
    if (a->reading && !a->failed) {
        t->bind_pose = *of->bind_pose;
        t->calibration = *of->calibration;
        t->depth_from_color = pose_inverse(of->calibration->color_from_depth);
        t->threads = 1;
        t->voxels = calloc((size_t)points, sizeof *t->voxels);
        a->failed = a->out_of_memory = !t->voxels;
    }
    if (!a->failed)
        voxels_archive(a, t->voxels, (int32_t)points);
    if (a->reading && !a->failed)
        a->failed = !numbers_are_sound(t, (int32_t)points);
    if (a->reading && a->failed)
        tsdf_close(v);
}
