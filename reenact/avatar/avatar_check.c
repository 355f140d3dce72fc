#include "reenact/avatar/avatar_check.h"

#include "reenact/avatar/deformation_grid.h"

// Farther, brighter, later than anything that a sensor sees of a person; chosen by hand so that sums and conversions of
// what passes cannot overflow.
#define MOST_M     100.0
#define MOST_COLOR 1000.0
#define MOST_S     1e7
#define UNIT_ERROR 1e-3 // of a unit vector's or quaternion's squared length

// False for what is not a number.
static bool within(double value, double most) { return fabs(value) <= most; }

static bool all_within(const double *values, size_t count, double most)
{
    bool good = true;
    for (size_t i = 0; i < count; i++)
        good &= within(values[i], most);
    return good;
}

static bool floats_within(const float *values, size_t count, double most)
{
    bool good = true;
    for (size_t i = 0; i < count; i++)
        good &= within((double)values[i], most);
    return good;
}

static bool points_within(const struct vec3 *points, int count, double most)
{
    return all_within(&points->x, 3 * (size_t)count, most);
}

static bool is_unit(struct vec3 v) { return within(v3_dot(v, v) - 1, UNIT_ERROR); }

static bool pose_is_rigid(const struct pose *p)
{
    const struct quat q = p->rotation;
    return within(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1, UNIT_ERROR) &&
           points_within(&p->translation, 1, MOST_M);
}

static bool indices_within(const int32_t *numbers, int count, int32_t least, int32_t limit)
{
    for (int i = 0; i < count; i++)
        if (numbers[i] < least || numbers[i] >= limit)
            return false;
    return true;
}

// ------------------------------------------------------------- the parts

static bool bind_pose_is_sound(const struct bind_pose *b)
{
    bool good = points_within(b->skeleton.joint, JOINT_COUNT, MOST_M) &&
                floats_within(b->skeleton.confidence, JOINT_COUNT, 1) &&
                all_within(b->own_length, BONE_COUNT, MOST_M) && all_within(b->radius, BONE_COUNT, MOST_M);
    for (int i = 0; i < BONE_COUNT && good; i++) {
        const struct bone_frame *f = &b->frame[i];
        if (b->known[i])
            good = points_within(&f->origin, 1, MOST_M) && within(f->length, MOST_M) && is_unit(f->x) &&
                   is_unit(f->y) && is_unit(f->z) && b->radius[i] >= 0;
    }
    for (int j = 0; j < JOINT_COUNT && good; j++)
        good = covariance_is_finite(b->skeleton.covariance[j]);
    return good && b->known[PART_UPPER_TORSO];
}

static bool surface_is_sound(const struct avatar *f)
{
    const struct surface_mesh *s = &f->surface;
    const struct vertex_colors *c = &f->vertex_colors;
    const size_t points = (size_t)s->point_count;
    bool good = s->point_count > 0 && s->corner_count > 0 && s->corner_count % 3 == 0 &&
                indices_within(s->corners, s->corner_count, 0, s->point_count) &&
                points_within(s->points, s->point_count, MOST_M) &&
                points_within(s->normals, s->point_count, 1 + UNIT_ERROR) &&
                floats_within(c->color[0], 3 * points, MOST_COLOR) && floats_within(c->time_s, points, MOST_S) &&
                floats_within(c->irradiance.term, SH_TERMS, MOST_COLOR);
    good = good && deformation_grid_is_small(s);
    for (size_t i = 0; i < points && good; i++) {
        const struct skin_weights *w = &f->skins[i];
        good = floats_within(w->weight, SKIN_BONES, 1 + UNIT_ERROR);
        for (int k = 0; k < SKIN_BONES; k++)
            good = good && w->bone[k] < BONE_COUNT && w->weight[k] >= 0;
    }
    return good;
}

static bool atlas_is_sound(const struct texture_atlas *a, int surface_points)
{
    const struct uv_mesh *m = &a->mesh;
    const int triangles = m->corner_count / 3;
    bool good = m->point_count > 0 && triangles > 0 && indices_within(m->points, m->point_count, 0, surface_points) &&
                indices_within(m->corners, m->corner_count, 0, m->point_count) &&
                indices_within(m->neighbor[0], 3 * triangles, -1, triangles) &&
                points_within(a->points, m->point_count, MOST_M) &&
                points_within(a->normals, m->point_count, 1 + UNIT_ERROR);
    for (int i = 0; i < m->point_count && good; i++)
        good =
            m->at[i][0] >= 0 && m->at[i][0] <= (float)m->width && m->at[i][1] >= 0 && m->at[i][1] <= (float)m->height;
    return good;
}

static bool frames_are_sound(const struct avatar *f, const struct take *take)
{
    bool good = f->frame_count > 0;
    for (int i = 0; i < f->frame_count && good; i++) {
        good = f->frames[i] >= (i ? f->frames[i - 1] + 1 : 0) && f->frames[i] < take_frame_count(take);
        for (int b = 0; b < BONE_COUNT && good; b++)
            good = pose_is_rigid(&f->frame_corrections[i].bone[b]);
    }
    return good;
}

bool avatar_is_sound(const struct avatar *f, const struct take *take)
{
    const struct joint_noise *errors = &f->joint_errors;
    return bind_pose_is_sound(&f->bind_pose) && surface_is_sound(f) &&
           atlas_is_sound(&f->atlas, f->surface.point_count) && frames_are_sound(f, take) &&
           all_within(errors->m, BONE_COUNT, MOST_M) && all_within(errors->rad, BONE_COUNT, MOST_M);
}
