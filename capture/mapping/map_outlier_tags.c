// Tags that one sweep shows in two positions: moved during the sweep, or two tags of the same id. The map could hold
// only one of the positions, and frames that see the tag at the other would be placed wrongly; so it is left out.
#include "capture/mapping/map_internal.h"

// All chosen by hand.
// Landmark inliers that confirm a frame's pose without the tag.
enum { MIN_POINTS = 20 };
static const double INLIER_PX = 4;
// A tag is displaced by at least this share of its side; less is measurement error.
static const double MIN_OFFSET_SHARE = 0.5;
// An outlier tag is displaced in at least so many frames, and in at least one of so many of all.
enum { MIN_DISPLACED = 2, ONE_IN = 8 };

// Whether a frame shows its k-th tag elsewhere than the map has it.
static bool tag_is_displaced(const struct map *m, const struct map_frame *f, int32_t k)
{
    const struct map_tag *tag = &m->tags[f->tag_index[k]];
    const struct pose expected = pose_multiply(f->camera_from_world, tag->world_from_tag);
    return planar_pose_offset_m(tag->side_m, f->seen[k].ray, &expected) > MIN_OFFSET_SHARE * tag->side_m;
}

static bool landmarks_agree(const struct map *m, const struct map_frame *f)
{
    const struct lens *lens = &m->calibration.color;
    int agree = 0;
    for (int32_t i = 0; i < f->feature_count; i++) {
        const struct map_feature *s = &f->features[i];
        if (s->point < 0)
            continue;
        struct vec3 p = pose_apply(f->camera_from_world, m->points[s->point].world);
        agree += p.z > 0 && map_reprojection_px(lens, p, &s->feature) < INLIER_PX;
    }
    return agree >= MIN_POINTS;
}

// Whether the pose of the frame is confirmed without its k-th tag.
static bool pose_is_confirmed(const struct map *m, const struct map_frame *f, int32_t k)
{
    for (int32_t i = 0; i < f->seen_count; i++)
        if (i != k && m->tags[f->tag_index[i]].mapped && !tag_is_displaced(m, f, i))
            return true;
    return landmarks_agree(m, f);
}

static bool is_outlier_tag(const struct map *m, int32_t tag)
{
    int displaced = 0, all = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            if (f->tag_index[k] != tag || !pose_is_confirmed(m, f, k))
                continue;
            all++;
            displaced += tag_is_displaced(m, f, k);
        }
    }
    return displaced >= MIN_DISPLACED && displaced * ONE_IN >= all;
}

// Another tag fixes the gauge, else a frame.
static void choose_new_reference(struct map *m)
{
    int32_t best = map_most_observed_tag(m, true);
    if (best >= 0) {
        m->tags[best].fixed = true;
        return;
    }
    for (int32_t i = 0; i < m->frame_count && m->fixed_frame < 0; i++)
        if (m->frames[i].placed)
            m->fixed_frame = i;
}

void map_remove_outlier_tags(struct map *m)
{
    bool held = m->held_points > 0 || m->fixed_frame >= 0;
    for (int32_t t = 0; t < m->tag_count; t++)
        m->tags[t].outlier = m->tags[t].mapped && is_outlier_tag(m, t);
    for (int32_t t = 0; t < m->tag_count; t++) {
        if (m->tags[t].outlier)
            m->tags[t].mapped = m->tags[t].fixed = false;
        held = held || m->tags[t].fixed;
    }
    if (!held)
        choose_new_reference(m);
}
