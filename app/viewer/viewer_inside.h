// The viewer from within, for its tests and measurements alone: what a user sees on the screen or brings about by it,
// as values. All of it is the viewer's, and valid until viewer_close; a take's parts until another one is opened. The
// programs use viewer.h.
#pragma once
#include "app/camera/camera_feed.h"
#include "app/live/live_attempt.h"
#include "app/live/live_sensor.h"
#include "app/place/room_worker.h"
#include "app/ui/input_map.h"
#include "app/ui/screen_live.h"
#include "app/ui/take_list.h"
#include "app/view/take_view.h"
#include "app/viewer/room_things.h"
#include "app/viewer/viewer.h"

// What the screen shows, and how it reacts. Tests may change it as a button would.
struct view_state *viewer_state(struct viewer *viewer);
const struct screens *viewer_screens(const struct viewer *viewer); // where its controls and labels are
const struct input_map *viewer_input(const struct viewer *viewer); // what is pressed
struct ui *viewer_ui(struct viewer *viewer);                       // to draw with, between two frames
const struct take_list *viewer_takes(const struct viewer *viewer);

// The picture of the actor that was drawn last, what it was drawn for, and what draws it. After viewer_redraw
// the next drawing makes it again even where the same is asked for.
const struct take_view_image *viewer_image(const struct viewer *viewer);
const struct take_view_request *viewer_request(const struct viewer *viewer);
struct take_view *viewer_take_view(struct viewer *viewer); // NULL: no take is open
struct ui_box viewer_free_box(const struct viewer *viewer);
void viewer_redraw(struct viewer *viewer);

const struct frame_times *viewer_times(const struct viewer *viewer);
int64_t viewer_drawing_ns(const struct viewer *viewer);             // when the last frame was begun
struct resolution_governor *viewer_governor(struct viewer *viewer); // which may be set
// When it was last looked whether the file is still there: 0 looks at the next update.
void viewer_set_checked(struct viewer *viewer, int64_t checked_ns);

// The camera. The frame is the newest at the last update; NULL: none.
const struct camera_frame *viewer_camera_frame(const struct viewer *viewer);
struct camera_feed_state viewer_feed_state(const struct viewer *viewer); // as it is now
bool viewer_camera_rests(const struct viewer *viewer); // it is closed, since its images change nothing

// The live screens.
struct viewer_live_view {
    const struct live_page *page;
    const struct live_attempt *attempt; // of the summary
    const struct live_frame *frame;     // the sensor's newest at the last update; NULL: none
    struct live_sensor *sensor;         // NULL: no take is open, or no sensor
    int kept;                           // attempts that were written
    bool no_points_told;                // it was said that no body points are looked for
};
struct viewer_live_view viewer_live_view(struct viewer *viewer);

// The room about the actor.
struct viewer_room_view {
    const struct room_page *page;
    struct room_things *things;     // which tests may move
    struct room_worker *worker;     // NULL: not started yet
    const struct room_views *views; // NULL: the worker draws
    struct gpu_target *turning;     // the card's body; NULL: none was shown
    struct gpu_target *surface;     // the map behind the orbit; NULL: none was shown
    struct lens surface_lens;
    bool mesh_came, wants_filmed;
    bool *driven; // a robot was, in the place; tests may clear it
};
struct viewer_room_view viewer_room_view(struct viewer *viewer);
