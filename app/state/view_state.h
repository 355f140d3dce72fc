// What the screen shows and what hands have asked for: the whole of the app's
// behaviour without a window, a camera or a clock. Pure.
//
// Buttons, keys and the game pad all end in show_do; fingers on the picture in
// show_gesture; what the camera knows comes in through show_hear. What is to be
// drawn is read from the fields.
#pragma once
#include "app/state/gesture.h"
#include "app/state/orbit.h"
#include "app/state/playback_clock.h"

enum show_page {
    PAGE_TAKES, // choose one
    PAGE_WATCH,
    PAGE_TROUBLE, // nothing can be watched; show.trouble says why
};

enum show_sheet { SHEET_NONE, SHEET_LAYERS, SHEET_SPEED };

enum show_action {
    DO_NOTHING,
    DO_PLAY_PAUSE,
    DO_STEP_BACK,
    DO_STEP_ON,
    DO_TO_START,
    DO_TO_END,
    DO_SLOWER,
    DO_FASTER,
    DO_LOOP,
    DO_MIRROR,
    DO_ORBIT, // between the camera and walking round with a finger
    DO_SKELETON,
    DO_SOURCES,
    DO_INSET,
    DO_STRIP,
    DO_THEME,
    DO_MOVE,     // begin or end moving the actor
    DO_PUT_BACK, // the actor to where he was filmed
    DO_PHOTOGRAPH,
    DO_LAYERS,
    DO_SPEED, // open or close the sheet
    DO_BACK,  // one step out: sheet, moving, page, program
    DO_TAKES,
    DO_FULLSCREEN,
    DO_QUIT,
    DO_PREVIOUS,
    DO_NEXT,
    DO_CHOOSE, // on the page of takes
};

// What is known of the camera at an instant.
struct show_camera {
    bool there;          // one was asked for
    bool knows_place;    // the recording has a place to be found in
    bool knows_tags;     // and there are tags in it
    bool seeing;         // pictures come
    int64_t came_ns;     // the last one
    int64_t sight;       // number of the newest located picture; 0: none
    bool placed;         // it was located
    const char *trouble; // the camera's own sentence; "" none; borrowed for the call
    int32_t moved_tags;  // that hang elsewhere than the place has them
    int32_t first_moved; // the lowest number of them
};

// Where the actor stands: moved over the floor from where he was filmed, and turned about himself.
struct placement {
    double x_m, y_m, turn_rad;
    bool mirrored;
};

struct show {
    enum show_page page;
    enum show_sheet sheet;
    const char *trouble; // page trouble's sentence; borrowed

    int take, take_count; // chosen, or about to be
    bool take_wanted;     // `take` has to be opened
    struct player player;
    bool scrubbing, was_playing;

    bool orbiting;     // else through the camera
    bool orbit_wished; // by hand; else only because there is no camera to look through
    struct orbit orbit;
    struct placement placement;
    bool moving; // fingers move the actor, not the view
    bool skeleton, sources, inset, strip, dark, fullscreen;
    bool photo_wanted, quit;

    struct show_camera camera;
    char camera_trouble[512]; // its sentence, kept: the camera's may be another by now
    const char *ailing;       // what is amiss with the recording while it plays; NULL nothing; borrowed
    bool frozen;              // the camera is open and sends nothing
    double error_px;          // that the actor may be wrong by, in the pixels he is drawn with
    double presence;          // of the actor, 0..1: fades while it is not known where he stands
    double prepared;          // the share of the take's preparing that is done; 1: all
    bool model_shown;         // what was prepared is being drawn
    double freshness;         // 0..1: from the plain actor to the prepared one
    bool ever_placed;
    int64_t placed_ns;  // last time it was known
    int64_t stirred_ns; // last touch, for hiding the controls while playing
    char notice[160];   // passes after a while
    bool notice_warns;
    int64_t notice_until_ns;
    int64_t tag_moved_ns;   // since when the camera has known tags to be moved; 0: it does not
    int32_t tag_moved_said; // the first of those last told of; -1: none was
    int64_t now_ns;         // of the last show_tick
    bool changed;           // there is something new to draw; the drawer clears it
};

struct show show_start(int take_count, bool dark, int64_t now_ns);

// A take was opened: its length, and the view to begin with.
void show_take(struct show *s, int64_t length_ns, int64_t frames, const struct orbit *orbit, int64_t now_ns);
void show_fail(struct show *s, const char *sentence); // there is nothing to watch

void show_do(struct show *s, enum show_action action, int64_t now_ns);

// Fingers on the picture, in shares of its height. at: where the first finger lies on
// the floor before and after, metres; NULL where it points to no floor.
struct floor_drag {
    double from_x, from_y, to_x, to_y;
};
void show_gesture(struct show *s, const struct gesture *g, const struct floor_drag *at, int64_t now_ns);
void show_wheel(struct show *s, double notches, int64_t now_ns);

// The timeline is held at that share, or (held false) let go.
void show_scrub(struct show *s, bool held, double share, int64_t now_ns);
void show_set_speed(struct show *s, double speed, int64_t now_ns);
void show_set_error(struct show *s, double error_px);
void show_set_turn(struct show *s, double turn_rad);
void show_choose(struct show *s, int take);

void show_hear(struct show *s, const struct show_camera *camera, int64_t now_ns);
void show_ail(struct show *s, const char *sentence); // NULL: all is well again
void show_prepare(struct show *s, double share);     // of the take's preparing
void show_model(struct show *s, bool shown);         // the actor drawn last is the prepared one
void show_say(struct show *s, const char *notice, int64_t now_ns);
void show_warn(struct show *s, const char *notice, int64_t now_ns); // the same, of what went wrong; stays longer
void show_stir(struct show *s, int64_t now_ns);                     // somebody touched the screen

// Time goes by. Returns until when nothing changes by itself: INT64_MAX, or now_ns while something moves.
int64_t show_tick(struct show *s, int64_t now_ns);

// Nobody looked from one time to the other.
void show_slept(struct show *s, int64_t from_ns, int64_t to_ns);

// One sentence on what is amiss or what to do; NULL when all is well.
const char *show_hint(const struct show *s);

// Are the controls shown? They go away while it plays and nobody touches.
bool show_controls(const struct show *s);

// From where the take was filmed to where it is shown, without the mirror. anchor: the point he turns about.
struct pose placement_pose(const struct placement *p, struct vec3 anchor);
