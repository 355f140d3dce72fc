#include "capture/coaching/coach.h"

#include <stdio.h>
#include <string.h>

// All chosen by hand.
static const double RAISE_S = 0.4, CLEAR_S = 0.4;
static const double SLOW_S = 1.0 / 20; // between frames
enum { SLOW_FRAMES = 15 };             // of the last ones, counted up and down
// Of the median joint, in the colour image. The exposure is taken for half of a 30 Hz frame: indoors it is as long.
static const double BLUR_PX = 6, EXPOSURE_S = 1.0 / 60;
enum { ADVICE_EVERY = 3 };              // frames that were looked at
static const double DEPTH_WRONG = 0.03; // sensors of this kind are within one to two hundredths

static const char *const fault_texts[FAULT_COUNT] = {
    [FAULT_FROZEN] = "the sensor repeats its picture: unplug it and plug it in again",
    [FAULT_NO_COLOR] = "the colour camera gives no pictures: unplug the sensor and plug it in again",
    [FAULT_NO_DEPTH] =
        "there is hardly any depth: no sunlight on the actor, nothing in front of the sensor, 0.8 m away",
    [FAULT_DEPTH_WRONG] =
        "the sensor's depth contradicts the tags: measure their black squares, or calibrate the sensor",
    [FAULT_SLOW] = "the sensor delivers fewer than 20 pictures a second: plug it into a USB port of its own",
    [FAULT_DARK] = "too dark: switch more light on",
    [FAULT_BRIGHT] = "too bright: turn a lamp away from the actor, or close a curtain",
    [FAULT_SENSOR_PUSHED] = "the sensor was pushed: leave it still",
    [FAULT_SECOND_PERSON] = "another person is in the picture",
    [FAULT_NO_PERSON] = "no person is seen: step before the sensor, two to four metres away",
    [FAULT_FEET_OUTSIDE] = "step back: your feet are outside the picture",
    [FAULT_HEAD_OUTSIDE] = "step back: your head is outside the picture",
    [FAULT_SIDE_OUTSIDE] = "step to the middle: you are at the picture's edge",
    [FAULT_TOO_NEAR] = "step back: you are too near",
    [FAULT_TOO_FAR] = "come nearer: depth is coarse so far away",
    [FAULT_BLUR] = "more slowly: the picture is blurred",
};

static const char *const advice_texts[] = {
    [ADVICE_ENOUGH] = "every side is seen",    [ADVICE_TURN_LEFT] = "turn left",
    [ADVICE_TURN_RIGHT] = "turn right",        [ADVICE_LIFT_ARMS] = "lift your arms to the sides",
    [ADVICE_SPREAD_LEGS] = "spread your legs", [ADVICE_SHOW_SOLES] = "show the soles of your feet to the sensor",
};

const char *coach_fault_text(enum coach_fault fault) { return fault_texts[fault]; }

void coach_start(struct coach *c, const struct calibration *calibration, enum verdict_purpose purpose)
{
    memset(c, 0, sizeof *c);
    c->purpose = purpose;
    c->calibration = *calibration;
    scene_watch_reset(&c->scene);
    coverage_reset(&c->coverage);
    for (int f = 0; f < FAULT_COUNT; f++)
        c->fault[f].first_s = -1;
    snprintf(c->text, sizeof c->text, "%s", "looking");
}

// ---------------------------------------------------------------- faults

static void note_fault(struct coach *c, enum coach_fault fault, bool there, int64_t time_ns, bool at_once)
{
    struct coach_fault_record *r = &c->fault[fault];
    const double now_s = (double)(time_ns - c->first_ns) * 1e-9;
    if (there) {
        r->missed_ns = 0;
        r->seen_ns = r->seen_ns ? r->seen_ns : time_ns;
        if (!r->raised && (at_once || (double)(time_ns - r->seen_ns) * 1e-9 >= RAISE_S)) {
            r->raised = true;
            r->raised_s = (double)(r->seen_ns - c->first_ns) * 1e-9;
            r->first_s = r->first_s < 0 ? r->raised_s : r->first_s;
        }
    } else {
        r->seen_ns = r->raised ? r->seen_ns : 0;
        r->missed_ns = r->missed_ns ? r->missed_ns : time_ns;
        if (r->raised && (double)(time_ns - r->missed_ns) * 1e-9 >= CLEAR_S) {
            r->raised = false;
            r->seen_ns = 0;
        }
    }
    if (r->raised) {
        r->total_s += (double)(time_ns - c->last_ns) * 1e-9;
        if (now_s - r->raised_s > r->longest_s) {
            r->longest_s = now_s - r->raised_s;
            r->longest_from_s = r->raised_s;
        }
    }
}

// Median over the known joints of how far each moves in the colour image while it is exposed, pixels.
static double blur_of(const struct coach *c, const struct coach_frame *frame)
{
    const double passed_s = (double)(frame->time_ns - c->last_ns) * 1e-9;
    double sorted[JOINT_COUNT];
    int count = 0;
    if (!c->has_last || passed_s <= 0)
        return 0;
    const double focal = c->calibration.color.width ? c->calibration.color.fx : c->calibration.depth.fx;
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 now = frame->skeleton->joint[j], before = c->last_skeleton.joint[j];
        if (frame->skeleton->confidence[j] <= 0 || c->last_skeleton.confidence[j] <= 0 || now.z < 0.3)
            continue;
        const double dx = now.x - before.x, dy = now.y - before.y;
        const double px = sqrt(dx * dx + dy * dy) / passed_s * EXPOSURE_S * focal / now.z;
        int at = count++;
        for (; at > 0 && sorted[at - 1] > px; at--)
            sorted[at] = sorted[at - 1];
        sorted[at] = px;
    }
    return count ? sorted[count / 2] : 0;
}

static void look(struct coach *c, const struct coach_frame *frame)
{
    const struct scene_state before = c->said;
    const struct scene_view view = {&c->calibration, frame->color, frame->depth, frame->mask, c->unread_frames};
    c->unread_frames = 0;
    scene_watch_next(&c->scene, &view, &c->said);
    if (frame->unread == UNREAD_COLOR) {
        c->said.luma = before.luma;
        c->said.dark = before.dark;
        c->said.bright = before.bright;
    } else {
        c->no_color = c->calibration.color.width > 0 && !frame->color;
    }
}

static void note_scene(struct coach *c, const struct coach_frame *frame)
{
    if (frame->unread == UNREAD_ALL)
        c->unread_frames++;
    else
        look(c, frame);
    const struct scene_state s = c->said;
    const bool moved = frame->sensor_moves > c->sensor_moves;
    c->sensor_moves = frame->sensor_moves;
    c->luma = s.luma;
    const double step_s = frame->step_s > 0 ? frame->step_s : (double)(frame->time_ns - c->last_ns) * 1e-9;
    const bool late = c->frames > 0 && step_s > SLOW_S;
    c->slow_frames += late ? c->slow_frames < SLOW_FRAMES : -(c->slow_frames > 0);
    note_fault(c, FAULT_SLOW, c->slow_frames >= SLOW_FRAMES, frame->time_ns, false);
    note_fault(c, FAULT_FROZEN, s.frozen, frame->time_ns, false);
    note_fault(c, FAULT_NO_COLOR, c->no_color, frame->time_ns, false);
    note_fault(c, FAULT_NO_DEPTH, s.no_depth, frame->time_ns, false);
    note_fault(c, FAULT_DEPTH_WRONG, frame->depth_scale > 0 && fabs(frame->depth_scale - 1) > DEPTH_WRONG,
               frame->time_ns, false);
    note_fault(c, FAULT_DARK, s.dark, frame->time_ns, false);
    note_fault(c, FAULT_BRIGHT, s.bright, frame->time_ns, false);
    note_fault(c, FAULT_SENSOR_PUSHED, moved || s.pushed, frame->time_ns, true);
    note_fault(c, FAULT_SECOND_PERSON, s.second_person, frame->time_ns, false);
}

static void note_person(struct coach *c, const struct coach_frame *frame)
{
    const bool unread = frame->unread == UNREAD_ALL,
               there = frame->skeleton && (unread || (frame->mask && frame->depth));
    const struct framing_view in_view = {&c->calibration, frame->mask, frame->skeleton};
    if (!there)
        c->framing = (struct framing){.distance_m = 0};
    else if (!unread)
        c->framing = framing_of(&in_view);
    const struct framing f = c->framing;
    c->blur_px = there ? blur_of(c, frame) : 0;
    c->distance_m = f.distance_m;
    note_fault(c, FAULT_NO_PERSON, !there, frame->time_ns, false);
    note_fault(c, FAULT_FEET_OUTSIDE, f.feet_outside, frame->time_ns, false);
    note_fault(c, FAULT_HEAD_OUTSIDE, f.head_outside, frame->time_ns, false);
    note_fault(c, FAULT_SIDE_OUTSIDE, f.side_outside, frame->time_ns, false);
    note_fault(c, FAULT_TOO_NEAR, f.too_near, frame->time_ns, false);
    note_fault(c, FAULT_TOO_FAR, f.too_far, frame->time_ns, false);
    note_fault(c, FAULT_BLUR, c->blur_px > BLUR_PX, frame->time_ns, false);
    c->has_last = there;
    if (!there)
        return;
    c->last_skeleton = *frame->skeleton;
    const struct coverage_view view = {&c->calibration, frame->depth, frame->mask, frame->skeleton, c->blur_px};
    if (coverage_add(&c->coverage, &view) && !unread && c->coverage.looks % ADVICE_EVERY == 1) {
        if (c->purpose != PURPOSE_COMPARE)
            c->advice = advisor_next(&c->advisor, &c->coverage, frame->skeleton, frame->time_ns);
        c->share = coverage_share(&c->coverage);
    }
}

void coach_next(struct coach *c, const struct coach_frame *frame)
{
    if (!c->frames)
        c->first_ns = c->last_ns = frame->time_ns;
    note_scene(c, frame);
    note_person(c, frame);
    c->last_ns = frame->time_ns;
    c->frames++;
    const char *said = c->coverage.frames ? advice_texts[c->advice] : "looking for a person";
    if (c->coverage.frames && c->purpose == PURPOSE_COMPARE)
        said = "nothing is in the way";
    for (int f = FAULT_COUNT - 1; f >= 0; f--)
        if (c->fault[f].raised)
            said = fault_texts[f];
    snprintf(c->text, sizeof c->text, "%s", said);
}

const char *coach_text(const struct coach *c) { return c->text; }

bool coach_any_fault(const struct coach *c)
{
    bool any = false;
    for (int f = 0; f < FAULT_COUNT; f++)
        any |= c->fault[f].raised;
    return any;
}
