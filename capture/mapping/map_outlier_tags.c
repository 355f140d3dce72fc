// Tags that one sweep shows in two places: somebody hung them elsewhere meanwhile, or two tags have one number. A map
// holds only one of the places, and whoever sees the tag in the other is led astray; so it is left out.
#include "capture/mapping/map_internal.h"

// What of a picture has to vouch for its pose, beside the tag.
enum { LEAST_POINTS = 20 };
static const double AGREE_PX = 4;
// A picture that shows it less far off, of its side, is a bad picture.
static const double LEAST_SHARE = 0.5;
// So many pictures show it elsewhere, and at least one in so many of all.
enum { LEAST_ELSEWHERE = 2, ONE_IN = 8 };

// Whether a picture shows its k-th tag elsewhere than the map has it.
static bool is_elsewhere(const struct map *m, const struct map_frame *f, int32_t k)
{
    const struct map_tag *tag = &m->tags[f->which[k]];
    const struct pose expected = pose_multiply(f->camera_from_world, tag->world_from_tag);
    return square_off_m(tag->side_m, f->seen[k].ray, &expected) > LEAST_SHARE * tag->side_m;
}

static bool points_vouch(const struct map *m, const struct map_frame *f)
{
    const struct lens *lens = &m->calibration.color;
    int agree = 0;
    for (int32_t i = 0; i < f->feature_count; i++) {
        const struct map_feature *s = &f->features[i];
        if (s->point < 0)
            continue;
        struct vec3 p = pose_apply(f->camera_from_world, m->points[s->point].world);
        struct vec3 ray = lens_ray(lens, s->feature.at);
        agree += p.z > 0 && hypot(lens->fx * (p.x / p.z - ray.x), lens->fy * (p.y / p.z - ray.y)) < AGREE_PX;
    }
    return agree >= LEAST_POINTS;
}

// Whether the pose of the picture stands without its k-th tag.
static bool is_vouched(const struct map *m, const struct map_frame *f, int32_t k)
{
    for (int32_t i = 0; i < f->seen_count; i++)
        if (i != k && m->tags[f->which[i]].mapped && !is_elsewhere(m, f, i))
            return true;
    return points_vouch(m, f);
}

static bool is_astray(const struct map *m, int32_t tag)
{
    int elsewhere = 0, all = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            if (f->which[k] != tag || !is_vouched(m, f, k))
                continue;
            all++;
            elsewhere += is_elsewhere(m, f, k);
        }
    }
    return elsewhere >= LEAST_ELSEWHERE && elsewhere * ONE_IN >= all;
}

// The world is held by another tag, else by a picture.
static void hold_another(struct map *m)
{
    int32_t best = map_most_seen(m, true);
    if (best >= 0) {
        m->tags[best].held = true;
        return;
    }
    for (int32_t i = 0; i < m->frame_count && m->held_frame < 0; i++)
        if (m->frames[i].placed)
            m->held_frame = i;
}

void map_leave_out_astray(struct map *m)
{
    bool held = m->held_points > 0 || m->held_frame >= 0;
    for (int32_t t = 0; t < m->tag_count; t++)
        m->tags[t].astray = m->tags[t].mapped && is_astray(m, t);
    for (int32_t t = 0; t < m->tag_count; t++) {
        if (m->tags[t].astray)
            m->tags[t].mapped = m->tags[t].held = false;
        held = held || m->tags[t].held;
    }
    if (!held)
        hold_another(m);
}
