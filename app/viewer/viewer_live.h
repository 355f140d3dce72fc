// The viewer's live part: the sensor's frames, the judgement of attempts, and what the live screens are drawn from.
// Used by viewer.c alone.
#pragma once
#include "app/live/live_attempt.h"
#include "app/live/live_sensor.h"
#include "app/ui/screen_live.h"

struct viewer;

// The frame of the take and that of the live world put together: the actor's beginning beside the person.
struct live_anchor {
    bool known;
    double yaw_rad;           // by which a live direction is turned to be one of the take's
    struct vec3 person, left; // of the person, live world: on the floor; the unit vector to the left
    struct vec3 actor;        // of the actor, take's world: on the floor
};

struct viewer_live {
    struct live_keeper *keeper;
    struct live_sensor *sensor;
    struct movement reference;      // of the take
    struct movement mirrored;       // its mirror image
    int64_t offset_ns;              // of its first frame in the take
    struct body body;               // the actor's
    const struct live_frame *frame; // the newest at the last update; NULL: none
    struct live_anchor anchor;
    bool image_mirrored; // viewer.image shows the actor mirrored

    struct gpu_texture *picture, *front; // of the sensor's colour image
    bool has_front;                      // something stands before the actor in it
    int64_t uploaded;                    // number of the frame in `picture`
    uint8_t *rgba;                       // scratch, of `pixels`
    float *scratch;
    size_t pixels;

    int attempt, finished; // of live_state, as seen last
    int32_t first, end;    // the reference's frames that are done
    struct attempt_judge *judge;
    struct live_attempt shown; // of the summary
    int kept;                  // live_keeper_state.kept, as seen last
    bool no_points_told;       // that no body points are looked for

    // what the page borrows
    enum verdict verdicts[PART_COUNT], review_verdicts[PART_COUNT];
    struct skeleton person, ghost, attempt_figure, reference_figure;
    struct live_page page;
    struct overlay_stroke strokes[2 * FIGURE_STROKES_MAX]; // of the room: person and ghost
    struct overlay overlay;
    int64_t drawn_frame;               // number of the frame that was drawn last
    double latency_ms, latency_max_ms; // from a frame's arrival until it was presented: sum, worst
    int64_t presented;                 // frames so measured
};

// When a take was opened: reads its movement and opens the sensor. A take that cannot be judged is no error; the screen
// says so. ERR_MEMORY.
MUST_CHECK enum status viewer_live_open_take(struct viewer *v, const char *take);
void viewer_live_close(struct viewer *viewer);
void viewer_live_suspend(struct viewer *viewer, bool suspend);
void viewer_live_update(struct viewer *viewer, int64_t now_ns); // before view_state_tick
void viewer_live_after_tick(struct viewer *viewer, int64_t now_ns);

struct viewer_surface;
// The viewpoint of the figures beside each other, and of the summary.
void viewer_live_request(struct viewer *viewer, const struct viewer_surface *surface,
                         struct take_view_request *request);

// Draws the actor for the live screen, and fills live.page. *request: of an orbit or a camera image, as for watching;
// the mirror replaces lens and pose. ERR_DEVICE, ERR_MEMORY, and those of take_view_draw.
MUST_CHECK enum status viewer_live_draw(struct viewer *v, const struct viewer_surface *surface,
                                        struct take_view_request *request);
void viewer_live_presented(struct viewer *viewer, int64_t now_ns);
