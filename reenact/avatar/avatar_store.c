#include "reenact/avatar/avatar_store.h"

#include "base/archive.h"
#include "recording/prepared.h"
#include "reenact/avatar/avatar_check.h"
#include "reenact/avatar/tsdf_store.h"

#include <stdlib.h>

// archive_array for a typed pointer.
#define ARRAY(a, pointer, count)                                                                                       \
    do {                                                                                                               \
        void *array_ = (pointer);                                                                                      \
        archive_array((a), &array_, &(count), sizeof *(pointer));                                                      \
        (pointer) = array_;                                                                                            \
    } while (0)

static void bind_pose_archive(struct archive *a, struct bind_pose *b)
{
    ARCHIVE(a, b->skeleton.joint);
    ARCHIVE(a, b->skeleton.confidence);
    ARCHIVE(a, b->skeleton.covariance);
    for (int i = 0; i < BONE_COUNT; i++) {
        uint8_t known = b->known[i];
        ARCHIVE(a, known);
        b->known[i] = known != 0;
    }
    ARCHIVE(a, b->frame);
    ARCHIVE(a, b->own_length);
    ARCHIVE(a, b->radius);
}

// Arrays of the surface's points; *count comes back as their number, or the archive fails.
static void surface_archive(struct archive *a, struct avatar *f)
{
    struct surface_mesh *s = &f->surface;
    struct vertex_colors *c = &f->vertex_colors;
    int points = s->point_count, normals = points, colors = points, times = points, filled = points;
    ARRAY(a, s->points, points);
    ARRAY(a, s->normals, normals);
    ARRAY(a, c->color, colors);
    ARRAY(a, c->time_s, times);
    ARRAY(a, c->filled, filled);
    ARRAY(a, s->corners, s->corner_count);
    ARCHIVE(a, c->irradiance);
    s->point_count = points;
    a->failed |= normals != points || colors != points || times != points || filled != points;
}

// Field by field: the struct has padding.
static void skins_archive(struct archive *a, struct avatar *f)
{
    const size_t points = (size_t)f->surface.point_count;
    if (a->reading && !a->failed) {
        f->skins = malloc(points * sizeof *f->skins + 1);
        a->failed |= a->out_of_memory |= !f->skins;
    }
    for (size_t i = 0; i < points && !a->failed; i++) {
        ARCHIVE(a, f->skins[i].bone);
        ARCHIVE(a, f->skins[i].weight);
    }
}

static void atlas_archive(struct archive *a, struct texture_atlas *atlas)
{
    struct uv_mesh *m = &atlas->mesh;
    int points = m->point_count, at = points, moved = points, normals = points, triangles = m->corner_count / 3;
    ARCHIVE(a, m->width);
    ARCHIVE(a, m->height);
    a->failed |= m->width < 1 || m->height < 1 || m->width > 4096 || m->height > 4096;
    int texels = a->failed ? 0 : 3 * m->width * m->height, times = a->failed ? 0 : 4 * m->width * m->height;
    const int wanted_texels = texels, wanted_times = times;
    ARRAY(a, m->points, points);
    ARRAY(a, m->at, at);
    ARRAY(a, m->corners, m->corner_count);
    ARRAY(a, m->neighbor, triangles);
    ARRAY(a, atlas->points, moved);
    ARRAY(a, atlas->normals, normals);
    ARRAY(a, atlas->color, texels);
    ARRAY(a, atlas->seen_time, times);
    m->point_count = points;
    a->failed |= at != points || moved != points || normals != points || m->corner_count != 3 * triangles ||
                 texels != wanted_texels || times != wanted_times;
}

static void avatar_archive(struct archive *a, struct avatar *f)
{
    int corrections = f->frame_count;
    bind_pose_archive(a, &f->bind_pose);
    surface_archive(a, f);
    skins_archive(a, f);
    atlas_archive(a, &f->atlas);
    ARCHIVE(a, f->joint_errors);
    ARRAY(a, f->frames, f->frame_count);
    ARRAY(a, f->frame_corrections, corrections);
    a->failed |= corrections != f->frame_count;
}

enum status avatar_pack(const struct avatar *avatar, uint8_t **bytes, size_t *count)
{
    struct archive a = archive_writer();
    struct avatar copy = *avatar; // of the pointers; writing changes nothing
    avatar_archive(&a, &copy);
    tsdf_archive(&a, &copy.tsdf, NULL);
    if (!archive_is_whole(&a)) {
        free(a.bytes);
        return fail(ERR_MEMORY, "no memory to keep the avatar");
    }
    *bytes = a.bytes;
    *count = a.count;
    return OK;
}

enum status avatar_unpack(struct avatar *out, const struct take *take, const void *bytes, size_t count)
{
    struct archive a = archive_reader(bytes, count);
    *out = (struct avatar){0};
    avatar_archive(&a, out);
    if (!a.failed)
        tsdf_archive(&a, &out->tsdf, &(struct tsdf_of){&out->bind_pose, take_calibration(take)});
    if (archive_is_whole(&a) && avatar_is_sound(out, take))
        return OK;
    avatar_free(out);
    return a.out_of_memory ? fail(ERR_MEMORY, "no memory for the avatar")
                           : fail(ERR_CORRUPT, "what the recording keeps of the actor's model cannot be used");
}

enum status avatar_load(struct avatar *out, const struct take *take)
{
    uint8_t *bytes;
    size_t count;
    *out = (struct avatar){0};
    enum status status = prepared_read(take, PREPARED_AVATAR, AVATAR_VERSION, &bytes, &count);
    if (status != OK)
        return status;
    status = avatar_unpack(out, take, bytes, count);
    free(bytes);
    return status == ERR_CORRUPT ? NOTHING : status;
}

enum status avatar_save(const uint8_t *bytes, size_t count, const char *path, const struct take *take)
{
    return prepared_write(path, take, PREPARED_AVATAR, AVATAR_VERSION, bytes, count);
}

enum status avatar_obtain(struct avatar *out, struct take *take, const struct source_rays *rays,
                          const struct avatar_options *options)
{
    const enum status status = avatar_load(out, take);
    return status == OK ? OK : avatar_make(out, take, rays, options);
}
