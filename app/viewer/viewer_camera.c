// The viewer's part for the tablet's camera.
#include "app/camera/camera_texture.h"
#include "app/viewer/viewer_parts.h"

#include <stdlib.h>

static const int64_t REST_NS = 500000000; // how long images must be unneeded before the camera is closed; by hand

struct viewer_camera {
    struct viewer_shared *shared;
    struct camera_feed *feed; // NULL: no camera
    struct camera_texture *texture;
    int64_t uploaded;    // camera_frame.number of the texture's image
    bool suspended;      // by the window
    bool rests;          // closed, since its images are not needed
    int64_t unneeded_ns; // since when; 0: they are needed
};

enum status viewer_camera_open(struct viewer_camera **out, struct viewer_shared *shared)
{
    struct viewer_camera *c = *out = calloc(1, sizeof *c);
    if (!c)
        return fail(ERR_MEMORY, "no memory for the camera");
    c->shared = shared;
    if (!shared->options.camera)
        return OK;
    enum status status = camera_texture_open(&c->texture, shared->gpu);
    if (status == OK) {
        const struct camera_feed_options how = {shared->options.camera, shared->has_place ? &shared->place : NULL,
                                                shared->options.wake, shared->options.wake_self,
                                                camera_texture_can_import(c->texture)};
        status = camera_feed_open(&c->feed, &how);
    }
    if (status != OK)
        viewer_camera_close(out);
    return status;
}

void viewer_camera_close(struct viewer_camera **camera)
{
    struct viewer_camera *c = *camera;
    if (!c)
        return;
    camera_texture_close(&c->texture);
    camera_feed_close(&c->feed);
    free(c);
    *camera = NULL;
}

void viewer_camera_suspend(struct viewer_camera *camera, bool suspend)
{
    camera->suspended = suspend;
    if (camera->feed)
        camera_feed_suspend(camera->feed, suspend || camera->rests);
}

// ---------------------------------------------------------------- time

static void tell_state(struct viewer_camera *camera, int64_t now_ns)
{
    struct viewer_shared *shared = camera->shared;
    struct camera_feed_state state = {0};
    struct view_camera seen = {.requested = camera->feed,
                               .has_place = shared->has_place,
                               .has_tags = shared->place.tag_count > 0,
                               .take_located = !shared->take_view || take_view_is_located(shared->take_view),
                               .trouble = ""};
    if (camera->feed) {
        const struct camera_frame *frame = shared->frame = camera_feed_latest(camera->feed);
        state = camera_feed_query(camera->feed);
        seen.seeing = state.seeing || camera->rests;
        seen.received_ns = camera->rests ? now_ns : state.received_ns;
        seen.frame = frame ? frame->number : 0;
        seen.placed = frame && frame->placed;
        seen.moved_tags = frame ? frame->moved_tags : 0;
        seen.first_moved = frame ? frame->first_moved : -1;
        seen.trouble = state.trouble;
    }
    view_state_on_camera(&shared->state, &seen, now_ns);
}

// The camera is not read while its images would change nothing: while the user walks round by hand, while the take is
// paused and the last image has its pose (that image then stays), and on live screens that do not show them.
static void rest(struct viewer_camera *camera, int64_t now_ns)
{
    const struct viewer_shared *shared = camera->shared;
    const struct view_state *s = &shared->state;
    const bool paused = !s->playback.playing && !s->scrubbing && shared->frame && shared->frame->placed;
    const bool live = s->page == PAGE_LIVE && (s->live.screen != LIVE_ROOM || s->live.phase == LIVE_SUMMARY);
    const bool unneeded =
        live || (s->page == PAGE_WATCH && shared->take_view && (s->orbit_requested || paused) && !s->moving);
    if (!camera->feed)
        return;
    if (!unneeded)
        camera->unneeded_ns = 0;
    else if (!camera->unneeded_ns)
        camera->unneeded_ns = now_ns;
    const bool rests = unneeded && now_ns - camera->unneeded_ns >= REST_NS;
    if (rests != camera->rests && !camera->suspended)
        camera_feed_suspend(camera->feed, rests);
    camera->rests = rests;
}

void viewer_camera_update(struct viewer_camera *camera, int64_t now_ns)
{
    tell_state(camera, now_ns);
    rest(camera, now_ns);
}

int64_t viewer_camera_due_ns(const struct viewer_camera *camera)
{
    return camera->unneeded_ns && !camera->rests ? camera->unneeded_ns + REST_NS : INT64_MAX;
}

// ---------------------------------------------------------------- drawing

enum status viewer_camera_upload(struct viewer_camera *camera)
{
    const struct camera_frame *frame = camera->shared->frame;
    if (!frame || frame->number == camera->uploaded)
        return OK;
    struct dmabuf_image *dmabuf = camera_feed_take_dmabuf(camera->feed);
    const enum status status = camera_texture_update(camera->texture, frame, &dmabuf);
    camera->uploaded = status == OK ? frame->number : 0;
    return status;
}

const struct gpu_texture *viewer_camera_texture(const struct viewer_camera *camera)
{
    return camera_texture_current(camera->texture);
}

void viewer_camera_presented(struct viewer_camera *camera)
{
    if (camera->feed)
        camera_feed_presented(camera->feed);
}

struct camera_feed_state viewer_camera_query(const struct viewer_camera *camera)
{
    return camera->feed ? camera_feed_query(camera->feed) : (struct camera_feed_state){0};
}

bool viewer_camera_is_resting(const struct viewer_camera *camera) { return camera->rests; }

void viewer_camera_print_stats(const struct viewer_camera *camera, FILE *out)
{
    if (!camera->texture)
        return;
    const struct camera_texture_counts c = camera_texture_count(camera->texture);
    fprintf(out, "camera    %lld pictures read where they lie, %lld uploaded%s%s\n", (long long)c.imported,
            (long long)c.uploaded, *c.why ? ": " : "", c.why);
}
