#include "capture/coaching/coach.h"

#include "base/depth_noise.h"
#include "base/portable_math.h"

#include <stdio.h>
#include <string.h>

// ---------------------------------------------------------------- framing

// All chosen by hand. A Kinect measures from 0.8 m, and a person of 1.8 m fits its picture from 2 m on; beyond 4.5 m
// its depth is uncertain by 3 cm.
static const double NEAR_M = 1.0, FAR_M = 4.5;
static const double SOLE_M = 0.09, CROWN_M = 0.13; // below the ankle, above the head's joint, of an adult
enum { MIN_PIXELS = 3 };                           // of the mask along an edge

// Mask pixels on the rows or columns nearest to an edge, where the depth image has any.
static int count_row(const struct lens *lens, const uint8_t *mask, int y)
{
    int count = 0;
    for (int x = 0; x < lens->width; x++)
        count += mask[y * lens->width + x] != 0;
    return count;
}

static int count_column(const struct lens *lens, const uint8_t *mask, int x)
{
    int count = 0;
    for (int y = 0; y < lens->height; y++)
        count += mask[y * lens->width + x] != 0;
    return count;
}

// The row of a point that lies `down_m` below a joint. Camera axes: y is down.
static double row_of(const struct lens *lens, struct pose depth_from_color, struct vec3 joint, double down_m)
{
    const struct vec3 p = pose_apply(depth_from_color, v3_add(joint, v3(0, down_m, 0)));
    return p.z > 0.1 ? lens->fy * p.y / p.z + lens->cy : lens->height;
}

static bool is_joint_known(const struct skeleton *skeleton, enum joint joint)
{
    return skeleton->confidence[joint] > 0;
}

static struct framing framing_of(const struct framing_view *view)
{
    const struct lens *l = &view->calibration->depth;
    const struct skeleton *s = view->skeleton;
    const struct pose depth_from_color = pose_inverse(view->calibration->color_from_depth);
    struct framing f = {.distance_m = 0};
    bool low = false, high = false;
    for (int side = 0; side < 2; side++) {
        const enum joint foot = side ? JOINT_LEFT_FOOT : JOINT_RIGHT_FOOT;
        low |= is_joint_known(s, foot) && row_of(l, depth_from_color, s->joint[foot], SOLE_M) > l->height - 1;
    }
    high = is_joint_known(s, JOINT_HEAD) && row_of(l, depth_from_color, s->joint[JOINT_HEAD], -CROWN_M) < 0;
    // Registered depth may leave some rows at the edges empty: an edge counts within a hundredth of the picture.
    const int margin_y = l->height / 100, margin_x = l->width / 100;
    f.feet_outside = low || count_row(l, view->mask, l->height - 1 - margin_y) >= MIN_PIXELS;
    f.head_outside = high || count_row(l, view->mask, margin_y) >= MIN_PIXELS;
    f.side_outside = count_column(l, view->mask, margin_x) >= MIN_PIXELS ||
                     count_column(l, view->mask, l->width - 1 - margin_x) >= MIN_PIXELS;
    if (is_joint_known(s, JOINT_WAIST)) {
        f.distance_m = s->joint[JOINT_WAIST].z;
        f.too_near = f.distance_m < NEAR_M;
        f.too_far = f.distance_m > FAR_M;
    }
    return f;
}

// ---------------------------------------------------------------- scene watch

// All chosen by hand.
static const int STILL_FRAMES = 90;        // what has not moved for so long is background: 3 s at 30 Hz
static const int SURE_FRAMES = 3;          // that show something farther than the background
static const int FROZEN_FRAMES = 10;       // noise alone changes a live picture from frame to frame
static const int PUSHED_FRAMES = 4;        // that agree
static const int MAX_FRAMES = 3;           // that one view counts for: never is one alone believed
static const double PUSHED_SHARE = 0.15;   // of the cells changed, and in three quarters of the picture ...
static const double PUSHED_QUARTER = 0.08; // ... this share at least
static const double PERSON_M2 = 0.12;      // a child's body that shows in part
static const double PERSON_HEIGHT_M = 0.7; // lower things are chairs, bags, dogs
static const double MIN_DEPTH_SHARE = 0.1;
static const double DARK = 40, BRIGHT = 225; // grey levels

void scene_watch_reset(struct scene_watch *watch) { memset(watch, 0, sizeof *watch); }

// Differences below this are noise or the edges of things, millimetres.
static int tolerance_mm(int mm) { return 40 + (int)(4e3 * depth_sigma_m(mm * 1e-3)); }

struct grid {
    uint16_t depth[SCENE_CELLS];
    bool actor[SCENE_CELLS]; // or beside it
};

static void sample_scene(const struct scene_view *view, struct grid *grid)
{
    const struct lens *l = &view->calibration->depth;
    bool own[SCENE_CELLS];
    for (int r = 0; r < SCENE_ROWS; r++)
        for (int c = 0; c < SCENE_COLUMNS; c++) {
            const int x = (2 * c + 1) * l->width / (2 * SCENE_COLUMNS), y = (2 * r + 1) * l->height / (2 * SCENE_ROWS);
            const int i = y * l->width + x;
            grid->depth[r * SCENE_COLUMNS + c] = view->depth[i];
            own[r * SCENE_COLUMNS + c] = view->mask && view->mask[i];
        }
    // Three cells about the actor's: what the mask leaves out of hands and hair.
    enum { REACH = 3 };
    memset(grid->actor, 0, sizeof grid->actor);
    for (int r = 0; r < SCENE_ROWS; r++)
        for (int c = 0; c < SCENE_COLUMNS; c++)
            if (own[r * SCENE_COLUMNS + c])
                for (int y = r < REACH ? 0 : r - REACH; y <= r + REACH && y < SCENE_ROWS; y++)
                    for (int x = c < REACH ? 0 : c - REACH; x <= c + REACH && x < SCENE_COLUMNS; x++)
                        grid->actor[y * SCENE_COLUMNS + x] = true;
}

static bool is_frozen(struct scene_watch *watch, const struct grid *grid, int frames)
{
    const bool same = watch->frames > 0 && !memcmp(grid->depth, watch->last, sizeof watch->last);
    watch->same_frames = same ? watch->same_frames + frames : 0;
    return watch->same_frames >= FROZEN_FRAMES;
}

static bool is_pushed(struct scene_watch *watch, const struct grid *grid, int frames)
{
    int all[4] = {0}, changed[4] = {0}, wide = 0;
    for (int i = 0; i < SCENE_CELLS; i++) {
        if (grid->actor[i] || !grid->depth[i] || !watch->background[i])
            continue;
        const int quarter = 2 * (i / SCENE_COLUMNS >= SCENE_ROWS / 2) + (i % SCENE_COLUMNS >= SCENE_COLUMNS / 2);
        const int off = (int)grid->depth[i] - watch->background[i];
        all[quarter]++;
        changed[quarter] += off > tolerance_mm(grid->depth[i]) || off < -tolerance_mm(watch->background[i]);
    }
    double sum = 0, sum_changed = 0;
    for (int q = 0; q < 4; q++) {
        sum += all[q];
        sum_changed += changed[q];
        wide += all[q] > 0 && changed[q] > PUSHED_QUARTER * all[q];
    }
    const bool moved = wide >= 3 && sum_changed > PUSHED_SHARE * sum;
    watch->moved_frames = moved ? watch->moved_frames + frames : 0;
    return watch->moved_frames >= PUSHED_FRAMES;
}

static void learn_background(struct scene_watch *watch, const struct grid *grid, int frames)
{
    for (int i = 0; i < SCENE_CELLS; i++) {
        const int z = grid->depth[i];
        if (!z)
            continue;
        const int off = z > watch->last[i] ? z - watch->last[i] : watch->last[i] - z;
        watch->still[i] =
            (uint16_t)(watch->last[i] && off < tolerance_mm(z) && watch->still[i] < 60000 ? watch->still[i] + frames
                                                                                          : 0);
        if (grid->actor[i])
            continue;
        const int behind = z - watch->background[i];
        if (!watch->background[i] || watch->still[i] > STILL_FRAMES ||
            (behind > tolerance_mm(z) && watch->still[i] >= SURE_FRAMES))
            watch->background[i] = (uint16_t)z;
        else if (behind > -tolerance_mm(z) && behind < tolerance_mm(z)) // its mean: a maximum would grow with the noise
            watch->background[i] = (uint16_t)(watch->background[i] + behind / 4);
    }
}

// The largest connected piece in front of the background, as a person would be: by flood fill on the grid.
static bool shows_person(const struct scene_watch *watch, const struct grid *grid, const struct lens *lens)
{
    bool front[SCENE_CELLS];
    int16_t stack[SCENE_CELLS];
    const double cell_w = (double)lens->width / SCENE_COLUMNS / lens->fx,
                 cell_h = (double)lens->height / SCENE_ROWS / lens->fy;
    for (int i = 0; i < SCENE_CELLS; i++)
        front[i] = !grid->actor[i] && grid->depth[i] && watch->background[i] &&
                   grid->depth[i] + 2 * tolerance_mm(watch->background[i]) < watch->background[i];
    for (int start = 0; start < SCENE_CELLS; start++) {
        int top = 0, first_row = SCENE_ROWS, last_row = 0;
        double area = 0, depth = 0, count = 0;
        if (!front[start])
            continue;
        front[start] = false;
        stack[top++] = (int16_t)start;
        while (top) {
            const int i = stack[--top], r = i / SCENE_COLUMNS, c = i % SCENE_COLUMNS;
            const double z = grid->depth[i] * 1e-3;
            area += z * z * cell_w * cell_h;
            depth += z;
            count++;
            first_row = r < first_row ? r : first_row;
            last_row = r > last_row ? r : last_row;
            const int next[4] = {c ? i - 1 : i, c < SCENE_COLUMNS - 1 ? i + 1 : i, r ? i - SCENE_COLUMNS : i,
                                 r < SCENE_ROWS - 1 ? i + SCENE_COLUMNS : i};
            for (int k = 0; k < 4; k++)
                if (front[next[k]]) {
                    front[next[k]] = false;
                    stack[top++] = (int16_t)next[k];
                }
        }
        if (area >= PERSON_M2 && (last_row - first_row + 1) * cell_h * depth / count >= PERSON_HEIGHT_M)
            return true;
    }
    return false;
}

static double mean_luma(const struct scene_view *view)
{
    const struct calibration *calibration = view->calibration;
    const struct lens *l = &calibration->color;
    double sum = 0, count = 0;
    const bool masked = view->mask && calibration->registered && calibration->depth.width > 0;
    for (int y = 4; y < l->height; y += 8)
        for (int x = 4; x < l->width; x += 8) {
            const uint8_t *rgb = view->color + 3 * (y * l->width + x);
            if (masked && !view->mask[y * calibration->depth.height / l->height * calibration->depth.width +
                                      x * calibration->depth.width / l->width])
                continue;
            sum += 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
            count++;
        }
    return count > 0 ? sum / count : -1;
}

static void scene_watch_next(struct scene_watch *watch, const struct scene_view *view, struct scene_state *out)
{
    *out = (struct scene_state){.luma = -1};
    if (view->color) {
        out->luma = mean_luma(view);
        out->dark = out->luma >= 0 && out->luma < DARK;
        out->bright = out->luma > BRIGHT;
    }
    if (!view->depth)
        return;
    struct grid g;
    int valid = 0;
    const int frames = view->skipped < MAX_FRAMES ? view->skipped + 1 : MAX_FRAMES;
    sample_scene(view, &g);
    for (int i = 0; i < SCENE_CELLS; i++)
        valid += g.depth[i] != 0;
    out->no_depth = valid < MIN_DEPTH_SHARE * SCENE_CELLS;
    out->frozen = is_frozen(watch, &g, frames) && !out->no_depth;
    out->pushed = is_pushed(watch, &g, frames);
    if (out->pushed) { // everything is learned again
        memset(watch->background, 0, sizeof watch->background);
        memset(watch->still, 0, sizeof watch->still);
        watch->moved_frames = 0;
    }
    out->second_person = shows_person(watch, &g, &view->calibration->depth);
    if (!watch->moved_frames)
        learn_background(watch, &g, frames);
    memcpy(watch->last, g.depth, sizeof watch->last);
    watch->frames += frames;
}

// ---------------------------------------------------------------- pose advice

static const double PI = 3.14159265358979323846;

// All chosen by hand.
enum { FACED_FRAMES = 3, FACED_REACH = 2 }; // a side was faced in so many frames, within two sectors: 45 degrees
static const double TURN_SHARE = 0.02,
                    POSE_SHARE = 0.02;    // of the surface: less is some dozens of pixels in the picture
static const double LIFTED_COSINE = 0.6;  // of the upper arm against straight down: 53 degrees
static const double SPREAD_COSINE = 0.94; // between the thighs: 20 degrees
static const double PATIENCE_S = 8;
static const double SOLE_COSINE = 0.5, SOLE_SEEN = 0.5; // of the shin against straight down; share of the sole
enum { SOLE_TIMES = 10 };                               // a second, at one call in three frames

static bool is_sector_faced(const uint32_t facing[SURFACE_ANGLES], int sector)
{
    uint32_t frames = 0;
    for (int k = -FACED_REACH; k <= FACED_REACH; k++)
        frames += facing[(sector + k + SURFACE_ANGLES) % SURFACE_ANGLES];
    return frames >= FACED_FRAMES;
}

static int sector_of(struct vec3 rest)
{
    const double angle = portable_atan2(rest.x, rest.y);
    return (int)floor(angle / (2 * PI) * SURFACE_ANGLES + SURFACE_ANGLES + 0.5) % SURFACE_ANGLES;
}

// Whether an unseen cell would show with lifted arms: the arms themselves and the trunk's sides.
static bool needs_arms(int part, int angle)
{
    const bool side = fabs(portable_sin(surface_angle(angle))) > 0.5;
    return (part >= PART_LEFT_UPPER_ARM && part <= PART_RIGHT_FOREARM) ||
           ((part == PART_UPPER_TORSO || part == PART_LOWER_TORSO) && side);
}

static bool needs_legs(int part) { return part >= PART_LEFT_THIGH && part <= PART_RIGHT_SHIN; }

// Unseen area by what would show it, as shares of the surface.
struct missing {
    double turn[SURFACE_ANGLES], turn_sum, arms, legs;
};

static struct missing missing_of(const struct coverage *coverage, const struct advisor *advisor)
{
    struct missing m = {.turn_sum = 0};
    double all = 0;
    for (int p = 0; p < SURFACE_PARTS; p++)
        for (int h = 0; h < SURFACE_HEIGHTS; h++)
            for (int k = 0; k < SURFACE_ANGLES; k++) {
                const double area = coverage_cell_area(coverage, p, h, k);
                const struct vec3 rest = surface_rest_direction(p, h, k);
                const bool level = portable_hypot(rest.x, rest.y) > 0.7;
                const int sector = sector_of(rest);
                all += area;
                if (area <= 0 || coverage_cell_seen(coverage, p, h, k))
                    continue;
                if (level && !is_sector_faced(coverage->facing, sector)) {
                    m.turn[sector] += area;
                    m.turn_sum += area;
                } else if (needs_arms(p, k) && !is_sector_faced(advisor->lifted, sector)) {
                    m.arms += area;
                } else if (needs_legs(p) && !is_sector_faced(advisor->spread, sector)) {
                    m.legs += area;
                }
            }
    for (int k = 0; k < SURFACE_ANGLES && all > 0; k++)
        m.turn[k] /= all;
    if (all > 0) {
        m.turn_sum /= all;
        m.arms /= all;
        m.legs /= all;
    }
    return m;
}

// By the mean of what is missing, seen from where the camera is now: a turn to the left by d brings the body's angle
// (camera - d) before the camera. A turn once begun is kept, so that the advice does not swing.
static enum pose_advice turn_advice(const struct advisor *advisor, const struct missing *missing, double facing)
{
    double left = 0, right = 0; // what the first half turn to either side would show, the nearest first
    for (int k = 0; k < SURFACE_ANGLES; k++) {
        double d = facing - k * 2 * PI / SURFACE_ANGLES;
        d -= 2 * PI * floor((d + PI) / (2 * PI));
        if (d > 0)
            left += missing->turn[k] / (0.3 + d);
        else
            right += missing->turn[k] / (0.3 - d);
    }
    if (advisor->last == ADVICE_TURN_LEFT)
        left *= 4;
    if (advisor->last == ADVICE_TURN_RIGHT)
        right *= 4;
    return left >= right ? ADVICE_TURN_LEFT : ADVICE_TURN_RIGHT;
}

static bool arm_lifted(const struct surface_pose *pose, int part)
{
    return pose->part[part].known && -v3_dot(pose->part[part].z, pose->up) < LIFTED_COSINE;
}

static void note_pose(struct advisor *advisor, const struct surface_pose *pose)
{
    const struct surface_frame *frame = &pose->part[PART_LEFT_THIGH], *r = &pose->part[PART_RIGHT_THIGH];
    const int sector =
        (int)floor(coverage_facing(pose) / (2 * PI) * SURFACE_ANGLES + SURFACE_ANGLES + 0.5) % SURFACE_ANGLES;
    if (arm_lifted(pose, PART_LEFT_UPPER_ARM) && arm_lifted(pose, PART_RIGHT_UPPER_ARM))
        advisor->lifted[sector]++;
    if (frame->known && r->known && v3_dot(frame->z, r->z) < SPREAD_COSINE)
        advisor->spread[sector]++;
    // Down is the sensor's, which stands within some degrees of level.
    for (int k = 0; k < 2; k++) {
        const struct surface_frame *shin = &pose->part[k ? PART_RIGHT_SHIN : PART_LEFT_SHIN];
        advisor->soles[k] += shin->known && shin->z.y < SOLE_COSINE;
    }
}

// Whether a sole was turned to the side for a while and was not seen: then a picture from there has to show it.
static bool needs_soles(const struct advisor *advisor, const struct coverage *coverage)
{
    for (int k = 0; k < 2; k++) {
        const int foot = k ? SURFACE_RIGHT_FOOT : SURFACE_LEFT_FOOT;
        double all = 0, seen = 0;
        for (int h = 0; h < SURFACE_HEIGHTS; h++)
            for (int angle = 0; angle < SURFACE_ANGLES; angle++) {
                if (portable_cos(surface_angle(angle)) > -0.5) // a foot's own front is up
                    continue;
                const double area = coverage_cell_area(coverage, foot, h, angle);
                all += area;
                seen += coverage_cell_seen(coverage, foot, h, angle) ? area : 0;
            }
        if (advisor->soles[k] >= SOLE_TIMES && seen < SOLE_SEEN * all)
            return true;
    }
    return false;
}

// A pose that is not taken is not asked for for ever.
static enum pose_advice request_pose(struct advisor *advisor, enum pose_advice wanted, int64_t time_ns, bool *refused)
{
    if (advisor->last != wanted)
        advisor->asked_ns = time_ns;
    else if ((double)(time_ns - advisor->asked_ns) * 1e-9 > PATIENCE_S)
        *refused = true;
    return wanted;
}

enum pose_advice advisor_next(struct advisor *advisor, const struct coverage *coverage, const struct skeleton *skeleton,
                              int64_t time_ns)
{
    struct surface_pose pose;
    if (!surface_pose_of(skeleton, &pose) || !pose.part[PART_UPPER_TORSO].known)
        return advisor->last;
    note_pose(advisor, &pose);
    const struct missing m = missing_of(coverage, advisor);
    enum pose_advice advice = ADVICE_ENOUGH;
    if (m.turn_sum > TURN_SHARE)
        advice = turn_advice(advisor, &m, coverage_facing(&pose));
    else if (m.arms > POSE_SHARE && !advisor->lift_refused)
        advice = request_pose(advisor, ADVICE_LIFT_ARMS, time_ns, &advisor->lift_refused);
    else if (m.legs > POSE_SHARE && !advisor->spread_refused)
        advice = request_pose(advisor, ADVICE_SPREAD_LEGS, time_ns, &advisor->spread_refused);
    else if (!advisor->soles_refused && needs_soles(advisor, coverage))
        advice = request_pose(advisor, ADVICE_SHOW_SOLES, time_ns, &advisor->soles_refused);
    advisor->last = advice;
    return advice;
}

// ---------------------------------------------------------------- coach

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

void coach_start(struct coach *coach, const struct calibration *calibration, enum verdict_purpose purpose)
{
    memset(coach, 0, sizeof *coach);
    coach->purpose = purpose;
    coach->calibration = *calibration;
    scene_watch_reset(&coach->scene);
    coverage_reset(&coach->coverage);
    for (int f = 0; f < FAULT_COUNT; f++)
        coach->fault[f].first_s = -1;
    snprintf(coach->text, sizeof coach->text, "%s", "looking");
}

// ---------------------------------------------------------------- faults

static void note_fault(struct coach *coach, enum coach_fault fault, bool there, int64_t time_ns, bool at_once)
{
    struct coach_fault_record *r = &coach->fault[fault];
    const double now_s = (double)(time_ns - coach->first_ns) * 1e-9;
    if (there) {
        r->missed_ns = 0;
        r->seen_ns = r->seen_ns ? r->seen_ns : time_ns;
        if (!r->raised && (at_once || (double)(time_ns - r->seen_ns) * 1e-9 >= RAISE_S)) {
            r->raised = true;
            r->raised_s = (double)(r->seen_ns - coach->first_ns) * 1e-9;
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
        r->total_s += (double)(time_ns - coach->last_ns) * 1e-9;
        if (now_s - r->raised_s > r->longest_s) {
            r->longest_s = now_s - r->raised_s;
            r->longest_from_s = r->raised_s;
        }
    }
}

// Median over the known joints of how far each moves in the colour image while it is exposed, pixels.
static double blur_of(const struct coach *coach, const struct coach_frame *frame)
{
    const double passed_s = (double)(frame->time_ns - coach->last_ns) * 1e-9;
    double sorted[JOINT_COUNT];
    int count = 0;
    if (!coach->has_last || passed_s <= 0)
        return 0;
    const double focal = coach->calibration.color.width ? coach->calibration.color.fx : coach->calibration.depth.fx;
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 now = frame->skeleton->joint[j], before = coach->last_skeleton.joint[j];
        if (frame->skeleton->confidence[j] <= 0 || coach->last_skeleton.confidence[j] <= 0 || now.z < 0.3)
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

static void update_scene(struct coach *coach, const struct coach_frame *frame)
{
    const struct scene_state before = coach->said;
    const struct scene_view view = {&coach->calibration, frame->color, frame->depth, frame->mask, coach->unread_frames};
    coach->unread_frames = 0;
    scene_watch_next(&coach->scene, &view, &coach->said);
    if (frame->unread == UNREAD_COLOR) {
        coach->said.luma = before.luma;
        coach->said.dark = before.dark;
        coach->said.bright = before.bright;
    } else {
        coach->no_color = coach->calibration.color.width > 0 && !frame->color;
    }
}

static void note_scene(struct coach *coach, const struct coach_frame *frame)
{
    if (frame->unread == UNREAD_ALL)
        coach->unread_frames++;
    else
        update_scene(coach, frame);
    const struct scene_state s = coach->said;
    const bool moved = frame->sensor_moves > coach->sensor_moves;
    coach->sensor_moves = frame->sensor_moves;
    coach->luma = s.luma;
    const double step_s = frame->step_s > 0 ? frame->step_s : (double)(frame->time_ns - coach->last_ns) * 1e-9;
    const bool late = coach->frames > 0 && step_s > SLOW_S;
    coach->slow_frames += late ? coach->slow_frames < SLOW_FRAMES : -(coach->slow_frames > 0);
    note_fault(coach, FAULT_SLOW, coach->slow_frames >= SLOW_FRAMES, frame->time_ns, false);
    note_fault(coach, FAULT_FROZEN, s.frozen, frame->time_ns, false);
    note_fault(coach, FAULT_NO_COLOR, coach->no_color, frame->time_ns, false);
    note_fault(coach, FAULT_NO_DEPTH, s.no_depth, frame->time_ns, false);
    note_fault(coach, FAULT_DEPTH_WRONG, frame->depth_scale > 0 && fabs(frame->depth_scale - 1) > DEPTH_WRONG,
               frame->time_ns, false);
    note_fault(coach, FAULT_DARK, s.dark, frame->time_ns, false);
    note_fault(coach, FAULT_BRIGHT, s.bright, frame->time_ns, false);
    note_fault(coach, FAULT_SENSOR_PUSHED, moved || s.pushed, frame->time_ns, true);
    note_fault(coach, FAULT_SECOND_PERSON, s.second_person, frame->time_ns, false);
}

static void note_person(struct coach *coach, const struct coach_frame *frame)
{
    const bool unread = frame->unread == UNREAD_ALL,
               there = frame->skeleton && (unread || (frame->mask && frame->depth));
    const struct framing_view in_view = {&coach->calibration, frame->mask, frame->skeleton};
    if (!there)
        coach->framing = (struct framing){.distance_m = 0};
    else if (!unread)
        coach->framing = framing_of(&in_view);
    const struct framing f = coach->framing;
    coach->blur_px = there ? blur_of(coach, frame) : 0;
    coach->distance_m = f.distance_m;
    note_fault(coach, FAULT_NO_PERSON, !there, frame->time_ns, false);
    note_fault(coach, FAULT_FEET_OUTSIDE, f.feet_outside, frame->time_ns, false);
    note_fault(coach, FAULT_HEAD_OUTSIDE, f.head_outside, frame->time_ns, false);
    note_fault(coach, FAULT_SIDE_OUTSIDE, f.side_outside, frame->time_ns, false);
    note_fault(coach, FAULT_TOO_NEAR, f.too_near, frame->time_ns, false);
    note_fault(coach, FAULT_TOO_FAR, f.too_far, frame->time_ns, false);
    note_fault(coach, FAULT_BLUR, coach->blur_px > BLUR_PX, frame->time_ns, false);
    coach->has_last = there;
    if (!there)
        return;
    coach->last_skeleton = *frame->skeleton;
    const struct coverage_view view = {&coach->calibration, frame->depth, frame->mask, frame->skeleton, coach->blur_px};
    if (coverage_add(&coach->coverage, &view) && !unread && coach->coverage.looks % ADVICE_EVERY == 1) {
        if (coach->purpose != PURPOSE_COMPARE)
            coach->advice = advisor_next(&coach->advisor, &coach->coverage, frame->skeleton, frame->time_ns);
        coach->share = coverage_share(&coach->coverage);
    }
}

void coach_next(struct coach *coach, const struct coach_frame *frame)
{
    if (!coach->frames)
        coach->first_ns = coach->last_ns = frame->time_ns;
    note_scene(coach, frame);
    note_person(coach, frame);
    coach->last_ns = frame->time_ns;
    coach->frames++;
    const char *said = advice_texts[coach->advice];
    if (!coach->coverage.frames)
        said = "looking for a person";
    else if (!coach->coverage.looks)
        said = "your trunk is hidden: turn a side to the sensor";
    else if (coach->purpose == PURPOSE_COMPARE)
        said = "nothing is in the way";
    for (int f = FAULT_COUNT - 1; f >= 0; f--)
        if (coach->fault[f].raised)
            said = fault_texts[f];
    snprintf(coach->text, sizeof coach->text, "%s", said);
}

const char *coach_text(const struct coach *coach) { return coach->text; }

bool coach_any_fault(const struct coach *coach)
{
    bool any = false;
    for (int f = 0; f < FAULT_COUNT; f++)
        any |= coach->fault[f].raised;
    return any;
}

// ---------------------------------------------------------------- verdict

// The verdict in words after a take: what was wrong, from when on, and what to do about it.

// All chosen by hand. A side of the trunk is called unseen below a quarter of it; a joint is guessed too often when
// more than a third of the frames infer it.
static const double UNSEEN = 0.25, GOOD_SHARE = 0.85, FAIR_SHARE = 0.7, GUESSED = 0.34;
// The outline (intersection over union) that the picture is expected to have all round, from the share of the body that
// was seen and the share of joints that were guessed: least squares over the twenty films of the tests' world in
// tests/system/test_verdict.c. With each film left out of its own fit the rank correlation with the outline is 0.82,
// the best of the seven forms that were compared by it, and so somewhat optimistic. A take that is good from all sides
// is expected above GOOD_GRADE.
static const double GRADE_NONE = 0.835, GRADE_SEEN = 0.105, GRADE_GUESSED = 0.136, GOOD_GRADE = 0.91;
static const double SHORT_S = 0.5; // a fault that lasted less is not worth a repeat

static const char *const past_texts[FAULT_COUNT] = {
    [FAULT_FROZEN] = "the sensor's picture stood still",
    [FAULT_NO_COLOR] = "the colour camera gave no pictures",
    [FAULT_NO_DEPTH] = "there was hardly any depth",
    [FAULT_DEPTH_WRONG] = "the sensor's depth contradicted the tags",
    [FAULT_SLOW] = "the sensor was slower than 20 pictures a second",
    [FAULT_DARK] = "it was too dark",
    [FAULT_BRIGHT] = "it was too bright",
    [FAULT_SENSOR_PUSHED] = "the sensor was pushed",
    [FAULT_SECOND_PERSON] = "another person was in the picture",
    [FAULT_NO_PERSON] = "no person was seen",
    [FAULT_FEET_OUTSIDE] = "feet missing",
    [FAULT_HEAD_OUTSIDE] = "head missing",
    [FAULT_SIDE_OUTSIDE] = "cut off at the picture's edge",
    [FAULT_TOO_NEAR] = "too near the sensor",
    [FAULT_TOO_FAR] = "too far from the sensor",
    [FAULT_BLUR] = "blurred by fast movement",
};

// Light and colour matter to those who look at the take.
static unsigned spoilt_uses(enum coach_fault fault)
{
    switch (fault) {
    case FAULT_BLUR: return 0;
    case FAULT_NO_COLOR:
    case FAULT_DARK:
    case FAULT_BRIGHT: return USE_WATCH;
    default: return USE_ANY;
    }
}

static void say_faults(const struct coach *coach, struct take_verdict *verdict)
{
    for (int f = 0; f < FAULT_COUNT; f++) {
        const struct coach_fault_record *r = &coach->fault[f];
        if (r->first_s < 0)
            continue;
        if (f == FAULT_SENSOR_PUSHED)
            verdict_say(verdict, USE_ANY, "%s at %.1f s: film again and leave it still", past_texts[f], r->first_s);
        else if (r->total_s >= SHORT_S)
            verdict_say(verdict, spoilt_uses((enum coach_fault)f), "%s from %.1f s to %.1f s", past_texts[f],
                        r->longest_from_s, r->longest_from_s + r->longest_s);
        if (f == FAULT_DEPTH_WRONG && verdict->count && r->total_s >= SHORT_S)
            verdict->line[verdict->count - 1].filming = true; // the frames do not say which tags were seen
    }
}

// The trunk's, the head's and the thighs' share of one side: limbs turn on their own.
static double side_share(const struct coverage *coverage, enum coverage_side side)
{
    static const int parts[] = {PART_HEAD, PART_UPPER_TORSO, PART_LOWER_TORSO, PART_LEFT_THIGH, PART_RIGHT_THIGH};
    double sum = 0;
    for (size_t i = 0; i < COUNT_OF(parts); i++)
        sum += coverage_part_share(coverage, parts[i], side);
    return sum / COUNT_OF(parts);
}

// The sides that were never seen, in words: "from behind and from your left". Their number.
static int unseen_sides(const struct coverage *coverage, char *out, size_t capacity)
{
    static const struct {
        enum coverage_side side;
        const char *from;
    } sides[] = {{COVERAGE_BACK, "from behind"},
                 {COVERAGE_FRONT, "from the front"},
                 {COVERAGE_LEFT, "from your left"},
                 {COVERAGE_RIGHT, "from your right"}};
    const char *unseen[COUNT_OF(sides)];
    int count = 0, used = 0;
    for (size_t i = 0; i < COUNT_OF(sides); i++)
        if (side_share(coverage, sides[i].side) < UNSEEN)
            unseen[count++] = sides[i].from;
    *out = 0;
    for (int i = 0; i < count; i++) {
        const char *before = i < count - 1 ? ", " : " and ";
        used += snprintf(out + used, capacity - (size_t)used, "%s%s", i ? before : "", unseen[i]);
    }
    return count;
}

static void say_coverage(const struct coach *coach, struct take_verdict *verdict)
{
    const struct coverage *coverage = &coach->coverage;
    const double share = coverage_share(coverage);
    char sides[120];
    if (!coverage->looks) { // the trunk was guessed throughout
        verdict->spoilt |= USE_WATCH;
        return;
    }
    const int unseen = unseen_sides(coverage, sides, sizeof sides);
    if (unseen)
        verdict_say(verdict, USE_WATCH, "%s it is guessed: turn round once to be seen from all sides", sides);
    for (int part = 0; part < SURFACE_PARTS && !unseen; part++)
        if (coverage->lengths[part] && coverage_part_share(coverage, part, COVERAGE_ALL_SIDES) < 0.5)
            verdict_say(verdict, share < GOOD_SHARE ? USE_WATCH : 0, "your %s was seen from few sides",
                        surface_part_name(part));
    if (share < FAIR_SHARE || unseen)
        verdict_say(verdict, USE_WATCH, "%.0f %% of the body was seen", share * 100);
    else if (share < GOOD_SHARE)
        verdict->spoilt |= USE_WATCH;
}

// Of all joints in all frames, how many were guessed.
static double guessed_share(const struct coverage *coverage)
{
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        sum += coverage->guessed[j];
    return sum / ((double)coverage->frames * JOINT_COUNT);
}

double coach_grade(const struct coach *coach)
{
    const struct coverage *coverage = &coach->coverage;
    return coverage->frames
               ? GRADE_NONE + GRADE_SEEN * coverage_share(coverage) - GRADE_GUESSED * guessed_share(coverage)
               : 0;
}

static void say_guessed(const struct coach *coach, struct take_verdict *verdict)
{
    const struct coverage *coverage = &coach->coverage;
    int worst = -1;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (coverage->guessed[j] > GUESSED * coverage->frames &&
            (worst < 0 || coverage->guessed[j] > coverage->guessed[worst]))
            worst = j;
    if (worst < 0)
        return;
    char name[32];
    snprintf(name, sizeof name, "%s", joint_name((enum joint)worst));
    for (char *at = name; *at; at++)
        *at = *at == '_' ? ' ' : *at;
    verdict_say(verdict, USE_ANY, "your %s was guessed in %.0f %% of the frames: keep it in sight of the sensor", name,
                100.0 * coverage->guessed[worst] / coverage->frames);
}

void coach_verdict(const struct coach *coach, struct take_verdict *out)
{
    *out = (struct take_verdict){.purpose = coach->purpose, .seen = coach->coverage.frames > 0};
    if (!out->seen) {
        out->spoilt = USE_ANY;
        return;
    }
    say_faults(coach, out);
    say_guessed(coach, out);
    say_coverage(coach, out);
    if (verdict_is_good_for(out, USE_WATCH) && coach_grade(coach) < GOOD_GRADE)
        verdict_say(out, USE_WATCH,
                    "%.0f %% of the joints were guessed: move more slowly, come nearer, keep hands and feet in sight",
                    100 * guessed_share(&coach->coverage));
    if (!out->count)
        verdict_say(out, 0, "%.0f %% of the body was seen, nothing was in the way",
                    coverage_share(&coach->coverage) * 100);
}
