// What is drawn over the actor's image at a depth of its own, and what is asked of it.
#include "reenact/render/actor_renderer_internal.h"

// Radii about strokes' ends and about points of which the room's depth is drawn. Chosen by hand.
static const double STROKE_M = 0.15, POINT_M = 0.02;

// Draws the room's depth where it may hide what is in the frustum. True: there is any.
static bool draw_room(struct renderer *p, const struct renderer_view *view, const struct occlusion_frustum *hidden)
{
    return hidden->farthest_m > 0 &&
           occlusion_shadow_draw_room(p->occlusion, actor_targets_room(p), view->viewer_from_room, hidden);
}

static bool draw_rooms(struct renderer *p, const struct renderer_view *view)
{
    const struct overlay *o = view->overlay;
    struct occlusion_frustum strokes = {0};
    bool any = false;
    for (int i = 0; i < o->stroke_count; i++) {
        occlusion_frustum_add(&strokes, o->strokes[i].from, STROKE_M);
        occlusion_frustum_add(&strokes, o->strokes[i].to, STROKE_M);
    }
    any = draw_room(p, view, &strokes);
    for (int g = 0; g < o->group_count && g < OVERLAY_GROUPS_MOST; g++) { // each alone: they may be far apart
        struct occlusion_frustum points = {0};
        for (int i = 0; i < OVERLAY_POINTS; i++)
            occlusion_frustum_add(&points, o->groups[g].point[i], POINT_M);
        any |= draw_room(p, view, &points);
    }
    return any;
}

enum status actor_overlay_draw(struct renderer *p, const struct renderer_view *view)
{
    enum status status = p->overlay ? OK : depth_overlay_open(&p->overlay, p->gpu);
    if (status == OK && view->overlay->stroke_count && !p->strokes) {
        status = gpu_target_open_color(&p->strokes, p->gpu, p->lens.width, p->lens.height);
        actor_targets_apply_scale(p);
    }
    if (status != OK)
        return status;
    if (view->viewer_from_room && draw_rooms(p, view))
        p->room_drawn = true;
    p->stroked = view->overlay->stroke_count > 0;
    if (p->stroked)
        gpu_target_clear(p->strokes);
    const bool apart = p->room_drawn && actor_targets_room(p) == p->room_depth;
    const struct overlay_picture picture = {
        gpu_target_depth(p->actor), apart ? gpu_target_texture(p->room_depth) : NULL, p->drawn, p->resolution_scale};
    depth_overlay_draw(p->overlay, p->strokes, &picture, view->overlay);
    return gpu_check(p->gpu);
}

const struct gpu_texture *renderer_overlay_texture(struct renderer *p)
{
    return p->stroked ? gpu_target_texture(p->strokes) : NULL;
}

enum status renderer_read_seen(struct renderer *p, float share[OVERLAY_GROUPS_MOST], int *count)
{
    *count = 0;
    return p->overlay ? depth_overlay_read(p->overlay, share, count) : OK;
}
