// A hash over everything that a reader returns of a recording: whether two files hold the same.
#pragma once
#include "tests/support/test.h"

#include "recording/recording.h"

#include <string.h>

// FNV-like hash over everything that a reader returns.
static inline uint64_t mix(uint64_t hash, const void *bytes, size_t count)
{
    for (const uint8_t *b = bytes; bytes && count--; b++)
        hash = (hash ^ *b) * UINT64_C(0x100000001b3);
    return hash ^ (bytes != NULL);
}

static inline uint64_t mix_take(uint64_t hash, struct recording *r, const char *name)
{
    struct take *t;
    hash = mix(hash, name, strlen(name));
    EXPECT_STATUS(take_open(&t, r, name), OK);
    hash = mix(hash, take_body(t)->radius_rate, sizeof take_body(t)->radius_rate);
    const struct calibration *c = take_calibration(t);
    const size_t depth = (size_t)c->depth.width * (size_t)c->depth.height,
                 color = (size_t)c->color.width * (size_t)c->color.height;
    for (int64_t k = 0; k < take_frame_count(t); k++) {
        struct take_images p;
        const struct take_entry *e = take_entry(t, k);
        EXPECT_STATUS(take_read(t, k, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &p), OK);
        hash = mix(hash, &e->time_ns, sizeof e->time_ns);
        hash = mix(hash, &e->world_from_camera, sizeof e->world_from_camera);
        hash = mix(hash, e->skeleton.joint, sizeof e->skeleton.joint);
        hash = mix(hash, e->skeleton.covariance, sizeof e->skeleton.covariance);
        hash = mix(hash, p.color, color * 3);
        hash = mix(hash, p.depth, depth * 2);
        hash = mix(hash, p.mask, depth);
    }
    take_close(&t);
    return hash;
}

static inline uint64_t hash_of(const char *path)
{
    struct recording *r;
    struct place place;
    uint64_t hash = 0xcbf29ce484222325u;
    EXPECT_STATUS(recording_open(&r, path), OK);
    if (recording_read_place(r, &place) == OK) {
        hash = mix(hash, place.tags, (size_t)place.tag_count * sizeof *place.tags);
        hash = mix(hash, place.points, (size_t)place.point_count * sizeof *place.points);
        const struct lens *lens = &place.calibration.depth;
        for (int i = 0; i < place.view_count; i++)
            hash = mix(hash, place.views[i].depth, (size_t)lens->width * (size_t)lens->height * 2);
        place_free(&place);
    }
    for (int i = 0; i < recording_take_count(r); i++)
        hash = mix_take(hash, r, recording_take_name(r, i));
    recording_free(&r);
    return hash;
}
