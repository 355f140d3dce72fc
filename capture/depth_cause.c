#include "capture/depth_cause.h"

#include "capture/sensor_pose.h"
#include "capture/tracking/tracker.h"

#include <stdlib.h>
#include <string.h>

// People from a small child to a giant. What is beyond is a wrong unit: of depth five times, twice, half or a tenth of
// what it is, all but half a tall adult and twice a toddler. The tracker's own error is about a tenth.
static const double MIN_STATURE_M = 0.82, MAX_STATURE_M = 2.35;
// By bones of which some are guessed: of people who kneel, sit or crouch all along, the tracker's stature is 0.79
// to 1.07 of the true one (16 films of the tests' world, of motions that it does not have).
static const double GUESSED_STATURE = 0.79;
enum { SEEN_ONE_IN = 10 }; // of the statures, that must be of bones that are all seen to stand for the others
// A hypothesis holds where a person is in so many of the frames, and the size is that of most people.
static const double HOLDS_SHARE = 0.7, HOLDS_MIN_M = 1.0, HOLDS_MAX_M = 2.1;
static const double FEW_SHARE = 0.5, // of the take's frames with a person: below it a cause is looked for
    MAX_SHARE = 0.95;                // above it the sensor stands upright
// No depth sensor for people measures as near or as far in the median of its pixels.
static const double NEAREST_M = 0.12, FARTHEST_M = 20;
static const double REACHED_SHARE = 0.05; // of the pixels have depth: below it nothing can be told

// A hypothesis is tried on so many frames at least: in one or two, furniture is a person as easily as a person is.
enum { FRAMES = 24, FRAMES_MIN = 8, SCENE_FRAMES = 4, COLUMNS_MAX = 320 };

struct depth_film {
    struct lens lens;
    int64_t time_ns[FRAMES];
    uint16_t *depth[FRAMES];
    int count;
};

// ------------------------------------------------------------- some frames of the take

static void film_free(struct depth_film *film)
{
    for (int i = 0; i < film->count; i++)
        free(film->depth[i]);
    film->count = 0;
}

static size_t film_pixels(const struct depth_film *film)
{
    return (size_t)film->lens.width * (size_t)film->lens.height;
}

// Every step-th pixel, so that the picture has at most COLUMNS_MAX columns.
static struct lens lens_reduced(const struct lens *lens, int step)
{
    struct lens r = *lens;
    r.width = lens->width / step;
    r.height = lens->height / step;
    r.fx /= step;
    r.fy /= step;
    r.cx = (lens->cx - step / 2) / step;
    r.cy = (lens->cy - step / 2) / step;
    return r;
}

static enum status keep_frame(struct depth_film *film, const struct lens *full, const uint16_t *depth, int64_t time_ns)
{
    const int step = full->width / film->lens.width;
    uint16_t *kept = malloc(film_pixels(film) * sizeof *kept);
    if (!kept)
        return fail(ERR_MEMORY, "no memory to judge a take");
    for (int y = 0; y < film->lens.height; y++)
        for (int x = 0; x < film->lens.width; x++)
            kept[y * film->lens.width + x] =
                depth[(size_t)(y * step + step / 2) * (size_t)full->width + (size_t)(x * step + step / 2)];
    film->depth[film->count] = kept;
    film->time_ns[film->count++] = time_ns;
    return OK;
}

// From the middle of the take, at most every third frame, as fast as a sensor's. scene_only: nobody is looked for in
// them, and fewer will do.
static enum status film_read(struct take *take, bool scene_only, struct depth_film *out)
{
    const struct lens *full = &take_calibration(take)->depth;
    const int64_t count = take_frame_count(take), stride = count >= 3 * FRAMES ? 2 : 1;
    const int64_t first = count > stride * FRAMES ? (count - stride * FRAMES) / 2 : 0;
    const int64_t max = scene_only ? SCENE_FRAMES : FRAMES, apart = stride * FRAMES / max;
    const int step = (full->width + COLUMNS_MAX - 1) / COLUMNS_MAX;
    enum status status = OK;
    *out = (struct depth_film){.count = 0};
    if (full->width <= 0)
        return OK;
    out->lens = lens_reduced(full, step);
    for (int64_t i = first; i < count && out->count < max && status == OK; i += apart) {
        struct take_images images;
        status = take_read(take, i, TAKE_DEPTH, &images);
        if (status == OK && images.depth) // at 15 Hz, whatever the film's own times are
            status = keep_frame(out, full, images.depth, (int64_t)out->count * 66666667 + 1);
        status = status == ERR_CORRUPT ? OK : status;
    }
    return status;
}

// ------------------------------------------------------------- the body's size

static double bone_length(const struct skeleton *skeleton, enum joint a, enum joint b)
{
    return v3_distance(skeleton->joint[a], skeleton->joint[b]);
}

// Soles to crown by the bones, 0: one of them is unknown. The head joint is half-way up the head, the foot the ankle;
// what lies beyond both is, of an adult, an eighth of the rest.
static double stature_m(const struct skeleton *skeleton)
{
    static const enum joint needed[] = {JOINT_HEAD,      JOINT_NECK,       JOINT_WAIST,
                                        JOINT_LEFT_HIP,  JOINT_LEFT_KNEE,  JOINT_LEFT_FOOT,
                                        JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT};
    for (size_t i = 0; i < COUNT_OF(needed); i++)
        if (skeleton->confidence[needed[i]] <= 0)
            return 0;
    const struct vec3 hips = v3_mix(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP], 0.5);
    const double left = bone_length(skeleton, JOINT_LEFT_HIP, JOINT_LEFT_KNEE) +
                        bone_length(skeleton, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT),
                 right = bone_length(skeleton, JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE) +
                         bone_length(skeleton, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT);
    return 1.125 * (bone_length(skeleton, JOINT_HEAD, JOINT_NECK) + bone_length(skeleton, JOINT_NECK, JOINT_WAIST) +
                    v3_distance(skeleton->joint[JOINT_WAIST], hips) + (left + right) / 2);
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double find_median(double *values, int count)
{
    if (!count)
        return 0;
    qsort(values, (size_t)count, sizeof *values, by_size);
    return values[count / 2];
}

static bool legs_are_seen(const struct skeleton *skeleton)
{
    static const enum joint needed[] = {JOINT_LEFT_HIP,  JOINT_LEFT_KNEE,  JOINT_LEFT_FOOT,
                                        JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT};
    for (size_t i = 0; i < COUNT_OF(needed); i++)
        if (skeleton->confidence[needed[i]] < 1)
            return false;
    return true;
}

// *seen: by bones of which none is guessed.
static double take_stature_m(const struct take *take, bool *seen)
{
    enum { MOST = 300 };
    double found[MOST], sure[MOST];
    int sure_used = 0;
    const int64_t count = take_frame_count(take), stride = (count + MOST - 1) / MOST;
    int used = 0;
    for (int64_t i = 0; i < count && used < MOST; i += stride) {
        const struct take_entry *e = take_entry(take, i);
        const double m = e->has_skeleton ? stature_m(&e->skeleton) : 0;
        if (m > 0)
            found[used++] = m;
        if (m > 0 && legs_are_seen(&e->skeleton))
            sure[sure_used++] = m;
    }
    *seen = sure_used > 0 && SEEN_ONE_IN * sure_used >= used;
    return *seen ? find_median(sure, sure_used) : find_median(found, used);
}

static bool stature_is_absurd(double m, bool seen)
{
    const double wider = seen ? 1 : GUESSED_STATURE;
    return m > 0 && (m < MIN_STATURE_M * wider || m > MAX_STATURE_M / wider);
}

static double person_share(const struct take *take)
{
    int64_t with = 0;
    const int64_t count = take_frame_count(take);
    for (int64_t i = 0; i < count; i++)
        with += take_entry(take, i)->has_skeleton;
    return count ? (double)with / (double)count : 0;
}

// ------------------------------------------------------------- hypotheses

// What the sensor, or who wrote the film, has made of the depth; undone, a person appears.
struct hypothesis {
    enum depth_cause cause;
    double factor;     // of CAUSE_UNIT
    int quarter_turns; // of the picture, by which it stands upright again
};

// In groups: of a later one nothing is tried where one before explains the film, since smooth pictures stay smooth by
// many a function, and turned or exchanged by one alone.
static const struct hypothesis exact[] = {{CAUSE_UPSIDE_DOWN, 0, 2},
                                          {CAUSE_ON_ITS_SIDE, 0, 1},
                                          {CAUSE_ON_ITS_SIDE, 0, 3},
                                          {CAUSE_BYTES_SWAPPED, 0, 0},
                                          {CAUSE_INVERTED, 0, 0}},
                               scaled[] = {{CAUSE_UNIT, 5, 0},     {CAUSE_UNIT, 2, 0},  {CAUSE_UNIT, 0.5, 0},
                                           {CAUSE_UNIT, 0.2, 0},   {CAUSE_UNIT, 10, 0}, {CAUSE_UNIT, 0.1, 0},
                                           {CAUSE_DISPARITY, 0, 0}},
                               inverse[] = {{CAUSE_DISPARITY, 1, 0}};

// Disparity as a Kinect's driver hands it out raw (K. Khoshelham, S. Oude Elberink 2012), or the plain inverse of
// depth, of which the scale is then taken from the median.
static double mm_of_disparity(const struct hypothesis *hypothesis, double raw, double median_raw)
{
    if (hypothesis->factor > 0)
        return raw > 0 ? 2500 * median_raw / raw : 0;
    return raw < 1084 ? 325600 / (1084.6 - raw) : 0;
}

static uint16_t undo_cause(const struct hypothesis *hypothesis, uint16_t d, double median_raw)
{
    double mm = d;
    switch (hypothesis->cause) {
    case CAUSE_UNIT: mm = d / hypothesis->factor; break;
    case CAUSE_BYTES_SWAPPED: return (uint16_t)((d >> 8) | (d << 8));
    case CAUSE_INVERTED: return d ? (uint16_t)(65535 - d) : 0;
    case CAUSE_DISPARITY: mm = mm_of_disparity(hypothesis, d, median_raw); break;
    default: break;
    }
    return mm < 65535 ? (uint16_t)(mm + 0.5) : 0;
}

// Where the pixel of the turned picture comes from.
static size_t source_of(const struct lens *lens, int turns, int x, int y)
{
    switch (turns) {
    case 1: return (size_t)(x * lens->width + (lens->width - 1 - y));
    case 2: return (size_t)((lens->height - 1 - y) * lens->width + (lens->width - 1 - x));
    case 3: return (size_t)((lens->height - 1 - x) * lens->width + y);
    default: return (size_t)(y * lens->width + x);
    }
}

static struct lens lens_turned(const struct lens *lens, int turns)
{
    struct lens t = {
        .width = lens->width, .height = lens->height, .fx = lens->fx, .fy = lens->fy, .cx = lens->cx, .cy = lens->cy};
    if (turns == 2) {
        t.cx = lens->width - 1 - lens->cx;
        t.cy = lens->height - 1 - lens->cy;
    } else if (turns) {
        t = (struct lens){.width = lens->height, .height = lens->width, .fx = lens->fy, .fy = lens->fx};
        t.cx = turns == 1 ? lens->cy : lens->height - 1 - lens->cy;
        t.cy = turns == 1 ? lens->width - 1 - lens->cx : lens->cx;
    }
    return t;
}

static void undo_picture(const struct depth_film *film, int frame, const struct hypothesis *hypothesis,
                         double median_raw, uint16_t *out)
{
    const struct lens t = lens_turned(&film->lens, hypothesis->quarter_turns);
    for (int y = 0; y < t.height; y++)
        for (int x = 0; x < t.width; x++)
            out[y * t.width + x] = undo_cause(
                hypothesis, film->depth[frame][source_of(&film->lens, hypothesis->quarter_turns, x, y)], median_raw);
}

struct trial {
    double share;     // of the frames with a person, in their second half
    double stature_m; // median; 0: none
};

// In an image that is the right way up, a person who stands: another way up they would be one who lies.
static bool is_upright(const struct skeleton *skeleton)
{
    const struct vec3 hips = v3_mix(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP], 0.5),
                      spine = v3_sub(skeleton->joint[JOINT_NECK], hips);
    return -spine.y > 0.7 * v3_length(spine);
}

// min_share: where the person is surely in fewer of the frames, the rest is not looked at, and `share` is too small.
static enum status try_hypothesis(const struct depth_film *film, const struct hypothesis *hypothesis, double median_raw,
                                  double min_share, struct trial *out)
{
    struct calibration c = {.depth = lens_turned(&film->lens, hypothesis->quarter_turns),
                            .color_from_depth = POSE_IDENTITY};
    struct tracker *tracker = NULL;
    uint16_t *depth = malloc(film_pixels(film) * sizeof *depth);
    double statures[FRAMES];
    int with = 0, looked = 0, sized = 0;
    const int most_without = (int)((1 - min_share) * (film->count - film->count / 2));
    *out = (struct trial){0};
    enum status status = depth ? tracker_open(&tracker, &c, NULL) : fail(ERR_MEMORY, "no memory to judge a take");
    for (int i = 0; i < film->count && status == OK; i++) {
        struct skeleton s;
        undo_picture(film, i, hypothesis, median_raw, depth);
        status = tracker_next(tracker, film->time_ns[i], depth, &s, NULL);
        const bool there = status == OK && (!hypothesis->quarter_turns || is_upright(&s));
        status = status == NOTHING ? OK : status;
        if (i < film->count / 2)
            continue;
        looked++;
        with += there;
        if (looked - with > most_without)
            break;
        const double m = there ? stature_m(&s) : 0;
        if (m > 0)
            statures[sized++] = m;
    }
    if (film->count >= FRAMES_MIN)
        *out = (struct trial){(double)with / looked, find_median(statures, sized)};
    tracker_close(&tracker);
    free(depth);
    return status;
}

static bool is_plausible(const struct trial *trial)
{
    return trial->share >= HOLDS_SHARE && trial->stature_m >= HOLDS_MIN_M && trial->stature_m <= HOLDS_MAX_M;
}

// Of the hypotheses that hold, the one with the person in most frames, and of equals the one whose size is most usual.
// A room's depths, once the unit is right, have a median of some metres: else furniture becomes a person.
static bool is_room(const struct hypothesis *hypothesis, double median_mm)
{
    return hypothesis->cause != CAUSE_UNIT ||
           (median_mm >= 700 * hypothesis->factor && median_mm <= 8000 * hypothesis->factor);
}

// How many neighbours in the middle frame have about the same depth, as surfaces have and noise has not.
static int count_smooth_neighbours(const struct depth_film *film, const struct hypothesis *hypothesis)
{
    const double same = 0.05;
    const uint16_t *depth = film->depth[film->count / 2];
    int smooth = 0;
    for (size_t i = 1; i < film_pixels(film); i++) {
        const double a = undo_cause(hypothesis, depth[i - 1], 0), b = undo_cause(hypothesis, depth[i], 0);
        smooth += a > 0 && b > 0 && fabs(a - b) < same * a;
    }
    return smooth;
}

// A floor is seen in frames turned by so much, and how often.
static int floors_seen(const struct depth_film *film, int quarter_turns, uint16_t *buffer)
{
    const struct hypothesis h = {CAUSE_NONE, 0, quarter_turns};
    const struct lens lens = lens_turned(&film->lens, quarter_turns);
    int seen = 0;
    for (int i = 0; i < film->count; i += 5) {
        struct floor_plane floor;
        undo_picture(film, i, &h, 0, buffer);
        seen += floor_plane_find(&lens, buffer, &floor);
    }
    return seen;
}

// A person's outline is one in any function of the depth. With fewer different readings than these in an image it is
// none of a depth sensor's, in whatever unit.
enum { LEVELS_MIN = 16 };

static bool has_levels(const struct depth_film *film)
{
    uint8_t seen[65536 / 8] = {0};
    const uint16_t *depth = film->depth[film->count / 2];
    int levels = 0;
    for (size_t i = 0; i < film_pixels(film) && levels < LEVELS_MIN; i++) {
        levels += !(seen[depth[i] >> 3] >> (depth[i] & 7) & 1);
        seen[depth[i] >> 3] |= (uint8_t)(1 << (depth[i] & 7));
    }
    return levels >= LEVELS_MIN;
}

// Exchanging the bytes of a right film makes noise of it, in which the tracker looks long for a person. In turned
// pictures furniture may stand like a person; where a floor lies in them as they are, it lies no better in them turned.
static bool is_likely(const struct depth_film *film, const struct hypothesis *hypothesis, uint16_t *buffer)
{
    static const struct hypothesis as_it_is = {CAUSE_NONE, 0, 0};
    if (hypothesis->quarter_turns)
        return floors_seen(film, hypothesis->quarter_turns, buffer) >= floors_seen(film, 0, buffer);
    return hypothesis->cause != CAUSE_BYTES_SWAPPED ||
           count_smooth_neighbours(film, hypothesis) > count_smooth_neighbours(film, &as_it_is);
}

static enum status try_all(const struct depth_film *film, const struct hypothesis *all, size_t count, double median_raw,
                           struct depth_finding *out)
{
    double best = 0;
    uint16_t *buffer = malloc(film_pixels(film) * sizeof *buffer);
    enum status status = buffer ? OK : fail(ERR_MEMORY, "no memory to judge a take");
    for (size_t i = 0; i < count && status == OK; i++) {
        struct trial t;
        if (!is_room(&all[i], median_raw) || !is_likely(film, &all[i], buffer))
            continue;
        status = try_hypothesis(film, &all[i], median_raw, HOLDS_SHARE, &t);
        const double unusual = t.stature_m > 0 ? fabs(t.stature_m - 1.65) : 9, worth = t.share - 0.3 * unusual;
        if (status != OK || !is_plausible(&t) || worth <= best)
            continue;
        best = worth;
        out->cause = all[i].cause;
        out->factor = all[i].cause == CAUSE_UNIT ? all[i].factor : 0;
    }
    free(buffer);
    return status;
}

// ------------------------------------------------------------- the scene

struct scene_numbers {
    double share, median; // of the pixels with depth, and of their depths, as they are in the take
};

static struct scene_numbers scene_of(const struct depth_film *film)
{
    uint32_t histogram[65536] = {0}, all = 0, below = 0;
    const size_t pixels = film_pixels(film);
    for (int i = 0; i < film->count; i++)
        for (size_t k = 0; k < pixels; k++)
            if (film->depth[i][k]) {
                histogram[film->depth[i][k]]++;
                all++;
            }
    int at = 0;
    while (at < 65535 && 2 * (below += histogram[at]) < all)
        at++;
    const double looked = (double)pixels * film->count;
    return (struct scene_numbers){looked > 0 ? all / looked : 0, at};
}

// Most of the picture is one plane across the line of sight, as a floor is from above: RANSAC over its points.
static bool looks_at_plane(const struct depth_film *film)
{
    enum { POINTS = 400, TRIES = 60 };
    const double level = 0.9, near_share = 0.02,
                 max = 0.45; // cosine to the line of sight; of the depth; of the points
    struct vec3 p[POINTS];
    int count = 0, best = 0;
    const size_t pixels = film_pixels(film), step = pixels / POINTS + 1;
    for (size_t k = step / 2; k < pixels && count < POINTS; k += step) {
        const struct pixel px = {(double)(k % (size_t)film->lens.width), (double)(k / (size_t)film->lens.width)};
        if (film->depth[film->count / 2][k])
            p[count++] = v3_scale(lens_ray(&film->lens, px), film->depth[film->count / 2][k] * 1e-3);
    }
    for (int t = 0; t < TRIES && count > 3; t++) {
        const struct vec3 a = p[t * 7919 % count], b = p[(t * 104729 + count / 3) % count],
                          c = p[(t * 1299709 + 2 * count / 3) % count];
        const struct vec3 n = v3_unit(v3_cross(v3_sub(b, a), v3_sub(c, a)));
        int on = 0;
        if (!(fabs(n.z) >= level))
            continue;
        for (int i = 0; i < count; i++)
            on += fabs(v3_dot(n, v3_sub(p[i], a))) < near_share * p[i].z;
        best = on > best ? on : best;
    }
    return count > POINTS / 4 && best > max * count;
}

// A plane across the line of sight and no floor, as far away as a ceiling's height.
static enum status looks_down(const struct depth_film *film, double median_mm, bool *out)
{
    uint16_t *buffer = malloc(film_pixels(film) * sizeof *buffer);
    if (!buffer)
        return fail(ERR_MEMORY, "no memory to judge a take");
    *out = median_mm > 1000 && median_mm < 6000 && looks_at_plane(film);
    for (int turns = 0; turns < 4 && *out; turns++)
        *out = !floors_seen(film, turns, buffer);
    free(buffer);
    return OK;
}

// Few frames have a person.
static enum status look_for_person(const struct depth_film *film, double median, struct depth_finding *out)
{
    bool down = false;
    enum status status = try_all(film, exact, COUNT_OF(exact), median, out);
    if (status == OK && out->cause == CAUSE_NONE)
        status = looks_down(film, median, &down);
    if (down)
        out->cause = CAUSE_FROM_ABOVE;
    if (status == OK && out->cause == CAUSE_NONE)
        status = try_all(film, scaled, COUNT_OF(scaled), median, out);
    if (status == OK && out->cause == CAUSE_NONE)
        status = try_all(film, inverse, COUNT_OF(inverse), median, out);
    return status;
}

// With points of the body from colour a person is found in a picture that hangs upside down, too, with left and right
// exchanged, but in fewer frames. Depth alone shows the person in the turned picture only.
static enum status look_upside_down(const struct depth_film *film, struct depth_finding *out)
{
    static const struct hypothesis as_it_is = {CAUSE_NONE, 0, 0}, turned = {CAUSE_UPSIDE_DOWN, 0, 2};
    struct trial plain, other;
    enum status status = try_hypothesis(film, &as_it_is, 0, 0, &plain);
    if (status == OK && plain.share <= 0.5)
        status = try_hypothesis(film, &turned, 0, 0, &other);
    if (status == OK && plain.share <= 0.5 && is_plausible(&other) && plain.share <= 0.5 * other.share)
        out->cause = CAUSE_UPSIDE_DOWN;
    return status;
}

// Of some frames all over the take, which need not show a person.
static enum status find_turn(struct take *take, enum depth_turn *out)
{
    enum { LOOKS = 6 };
    const struct calibration *c = take_calibration(take);
    const int64_t count = take_frame_count(take);
    struct stream_turn seen = {.images = 0};
    enum status status = OK;
    *out = DEPTH_STRAIGHT;
    for (int k = 0; k < LOOKS && k < count && c->color.width > 0 && c->depth.width > 0 && status == OK; k++) {
        struct take_images images;
        status = take_read(take, count * (2 * k + 1) / (2 * LOOKS), TAKE_COLOR | TAKE_DEPTH, &images);
        if (status == OK && images.color && images.depth)
            status = stream_turn_add(&seen, c, images.color, images.depth);
        status = status == ERR_CORRUPT ? OK : status;
    }
    *out = stream_turn_judge(&seen);
    return status;
}

enum status depth_cause_find(struct take *take, struct depth_finding *out)
{
    struct depth_film film;
    bool seen;
    *out = (struct depth_finding){.stature_m = take_stature_m(take, &seen)};
    const enum status turned = find_turn(take, &out->turn);
    if (turned != OK || out->turn != DEPTH_STRAIGHT) {
        out->cause = CAUSE_TURNED;
        return turned;
    }
    if (stature_is_absurd(out->stature_m, seen)) {
        out->cause = CAUSE_UNIT;
        return OK;
    }
    const double person = person_share(take);
    enum status status = film_read(take, person >= MAX_SHARE, &film);
    if (status == OK && film.count) {
        const struct scene_numbers scene = scene_of(&film);
        if (scene.share < REACHED_SHARE && person < FEW_SHARE)
            out->cause = CAUSE_NOTHING_IN_REACH;
        else if (person >= FEW_SHARE && person < MAX_SHARE)
            status = look_upside_down(&film, out);
        else if (person < FEW_SHARE && has_levels(&film))
            status = look_for_person(&film, scene.median, out);
        const bool absurd = scene.median < 1e3 * NEAREST_M || scene.median > 1e3 * FARTHEST_M;
        if (status == OK && out->cause == CAUSE_NONE && absurd)
            *out = (struct depth_finding){.cause = CAUSE_UNIT, .factor = scene.median < 1e3 * NEAREST_M ? 1e-3 : 1e3};
    }
    film_free(&film);
    return status;
}

// ------------------------------------------------------------- in words

static void say_unit(const struct depth_finding *finding, struct take_verdict *out)
{
    static const char *const cure = "put its unit right (unit_m in calibration.json) and record again";
    if (finding->stature_m > 0)
        verdict_say(out, USE_ANY, "the depth is in another unit, a person of %.2f m cannot be: %s", finding->stature_m,
                    cure);
    else if (finding->factor > 100)
        verdict_say(out, USE_ANY, "the depth is in another unit, most of it farther than any room: %s", cure);
    else if (finding->factor < 0.01)
        verdict_say(out, USE_ANY, "the depth is in another unit, most of it nearer than any sensor sees: %s", cure);
    else if (finding->factor > 1)
        verdict_say(out, USE_ANY, "the depth is in another unit, about %g times too long: %s", finding->factor, cure);
    else
        verdict_say(out, USE_ANY, "the depth is in another unit, about %g times too short: %s", 1 / finding->factor,
                    cure);
}

void depth_cause_say(const struct depth_finding *finding, struct take_verdict *out)
{
    static const char *const sentences[] = {
        [CAUSE_NOTHING_IN_REACH] =
            "hardly a pixel has depth: its unit is wrong (unit_m in calibration.json), or nothing "
            "stands within the sensor's reach",
        [CAUSE_BYTES_SWAPPED] =
            "the two bytes of each depth pixel are exchanged: write the high byte first, as PNG has "
            "it, and record again",
        [CAUSE_INVERTED] = "the depth is inverted, what is near has large numbers: write millimetres and record again",
        [CAUSE_DISPARITY] = "the depth pictures hold disparity, no distances: convert them to millimetres and record "
                            "again",
        [CAUSE_UPSIDE_DOWN] = "the sensor hangs upside down: turn it, or its pictures, and film again",
        [CAUSE_ON_ITS_SIDE] = "the sensor lies on its side: turn it, or its pictures, by 90 degrees and film again",
        [CAUSE_FROM_ABOVE] =
            "the sensor looks straight down, or at a bare wall: put it on a stand at the height of the chest",
    };
    if (finding->cause == CAUSE_TURNED)
        verdict_say(out, USE_ANY,
                    "the depth pictures are %s against the colour pictures: put one of the two streams right (a "
                    "driver's mirror setting, or what wrote the film) and record again",
                    depth_turn_text(finding->turn));
    else if (finding->cause == CAUSE_UNIT)
        say_unit(finding, out);
    else if (finding->cause != CAUSE_NONE)
        verdict_say(out, USE_ANY, "%s", sentences[finding->cause]);
}
