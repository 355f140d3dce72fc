#include "capture/mapping/map_advice.h"

#include "capture/mapping/map_frontend.h"
#include "capture/mapping/map_internal.h"
#include "locate/stream_turn.h"
#include "platform/files/jpeg.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

// ---------------------------------------------------------------- map plausibility

// Whether tags, depth and lens belong together. A wrong lens, depth in another unit and a wrong list all look like
// wrong tags at first. What tells them apart: a lens fitted to the finished map; then the sides that the depth shows,
// all by one factor; and depth that fits the tags only when it is mirrored.

// ---------------------------------------------------------------- depth that is mirrored

// All chosen by hand.
enum { MAX_RATIOS = 4096, MIN_RATIOS = 24, MAX_TURN_PICTURES = 16 };
// Depth of the right way round agrees with the tags' sizes to some hundredths. Another way is believed where it does
// so, and the given one is this many times as far off.
static const double TURNED_SPREAD = 0.06, TIMES_AS_FAR = 2.5;

static int compare_doubles(const void *left, const void *right)
{
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static double find_median(double *values, int count)
{
    qsort(values, (size_t)count, sizeof *values, compare_doubles);
    return values[count / 2];
}

// Depth over the distance that a tag's size tells, at the middle of its four quarters.
static int add_ratios(const struct map *map, const struct map_frame *frame, int32_t k, enum depth_turn turn,
                      double *out, int count)
{
    const struct lens *lens = &map->calibration.color;
    const double half = map->tags[frame->tag_index[k]].side_m / 2;
    struct pose two[2];
    if (!planar_poses(2 * half, frame->seen[k].ray, two))
        return count;
    for (int corner = 0; corner < 4 && count < MAX_RATIOS; corner++) {
        const struct vec3 own = {corner % 2 ? half / 2 : -half / 2, corner / 2 ? half / 2 : -half / 2, 0};
        const struct vec3 p = pose_apply(two[0], own);
        struct pixel at = lens_project(lens, p);
        if (turn == DEPTH_MIRRORED || turn == DEPTH_TURNED)
            at.x = lens->width - 1 - at.x;
        if (turn == DEPTH_FLIPPED || turn == DEPTH_TURNED)
            at.y = lens->height - 1 - at.y;
        const double z = feature_depth(lens, frame->depth, at);
        if (z > 0)
            out[count++] = z / p.z;
    }
    return count;
}

// How far depth and tags are apart, a share: the median deviation of their ratio from its median. 1: not known.
static double spread_of_depth(const struct map *map, enum depth_turn turn, double *ratios)
{
    int count = 0;
    for (int32_t i = 0; i < map->frame_count; i++)
        for (int32_t k = 0; map->frames[i].depth && k < map->frames[i].seen_count; k++)
            count = add_ratios(map, &map->frames[i], k, turn, ratios, count);
    if (count < MIN_RATIOS)
        return 1;
    const double middle = find_median(ratios, count);
    for (int i = 0; i < count; i++)
        ratios[i] = fabs(ratios[i] / middle - 1);
    return find_median(ratios, count);
}

// By the tags. False: too few of them show depth.
static bool turn_by_tags(const struct map *map, enum depth_turn *best)
{
    double ratios[MAX_RATIOS], min, straight;
    min = straight = spread_of_depth(map, DEPTH_STRAIGHT, ratios);
    *best = DEPTH_STRAIGHT;
    for (enum depth_turn turn = DEPTH_MIRRORED; turn < DEPTH_TURNS; turn++) {
        const double spread = spread_of_depth(map, turn, ratios);
        if (spread < min && spread < TURNED_SPREAD && straight < 1 && straight > TIMES_AS_FAR * spread) {
            min = spread;
            *best = turn;
        }
    }
    return straight < 1;
}

// By the edges of some of the pictures that are kept, spread over the sweep.
static enum status turn_by_edges(const struct map *map, enum depth_turn *best)
{
    const struct lens *lens = &map->calibration.color;
    const int32_t step = map->frame_count / MAX_TURN_PICTURES + 1;
    struct stream_turn seen = {.images = 0};
    enum status status = OK;
    uint8_t *rgb = malloc(lens_pixels(lens) * 3);
    if (!rgb)
        return fail(ERR_MEMORY, "no memory to compare colour and depth");
    for (int32_t i = 0, due = 0; i < map->frame_count && status == OK; i++) {
        const struct map_frame *f = &map->frames[i];
        if (i < due || !f->jpeg || !f->depth)
            continue;
        due = i + step;
        status = jpeg_decode(f->jpeg, f->jpeg_bytes, rgb, lens->width, lens->height);
        if (status == OK)
            status = stream_turn_add(&seen, &map->calibration, rgb, f->depth);
        status = status == ERR_CORRUPT ? OK : status;
    }
    *best = stream_turn_judge(&seen);
    free(rgb);
    return status;
}

enum status map_check_depth_turn(const struct map *map)
{
    enum depth_turn turn;
    if (!map->has_depth || !map_depth_usable(&map->calibration))
        return OK;
    const enum status status = turn_by_tags(map, &turn) ? OK : turn_by_edges(map, &turn);
    if (status != OK || turn == DEPTH_STRAIGHT)
        return status;
    return fail(ERR_INPUT, "the depth pictures are %s against the colour pictures: film both the same way round",
                depth_turn_text(turn));
}

// ---------------------------------------------------------------- lens and unit

enum { LENS_ROUNDS = 12 };

enum status map_judge(struct map *map, struct mapper_report *report)
{
    struct ba_lens fitted;
    const enum status status = map_fit_lens(map, LENS_ROUNDS, &fitted);
    if (status == ERR_SOLVER) // nothing can be told
        return OK;
    if (status != OK)
        return status;
    lens_judge(&fitted, &map->calibration.color, &report->lens);
    const double longer = report->lens.fault != LENS_FITS ? (fitted.focal[0] + fitted.focal[1]) / 2 : 1;
    report->depth_ratio = map->side_ratio / longer;
    return OK;
}

// ---------------------------------------------------------------- of use or not

// No sensor's scale, and no printer's, is off by so much; what is seen with such depth is elsewhere than what the tags
// say. Chosen by hand.
static const double MAX_RATIO = 1.25;
// Depth that contradicts the tags by this much on average, and by so many times its noise, is of something else.
static const double MAX_DEPTH_ERROR_M = 0.1, MAX_TIMES_NOISE = 4;
// Of so many tags seen, less than one in ONE_IN is left.
enum { MANY_TAGS = 4, ONE_IN = 2 };

static bool max_tags_lost(const struct map *map)
{
    int lost = 0, all = 0;
    for (int32_t t = 0; t < map->tag_count; t++) {
        all += map->tags[t].mapped || map->tags[t].outlier;
        lost += map->tags[t].outlier;
    }
    return all >= MANY_TAGS && ONE_IN * lost > all;
}

static enum status refuse_unit(double ratio)
{
    if (ratio > 0.6 && ratio < 1.6)
        return fail(
            ERR_INPUT,
            "by the depth most tags are %.2f times as wide as the list says: measure the outer edge of the black "
            "squares and correct the list of tags; if it is right, the depth's unit_m in calibration.json is "
            "%.2f times too large",
            ratio, ratio);
    return fail(ERR_INPUT,
                "the depth is %.4g times as far as the tags are by their size: divide its unit_m in "
                "calibration.json by that, or else all sides in the list of tags are wrong",
                ratio);
}

enum status map_check_use(const struct map *map, const struct mapper_report *report)
{
    char text[LENS_TEXT_BYTES];
    const bool far_off = map->rms_m > MAX_DEPTH_ERROR_M && map->rms_m > MAX_TIMES_NOISE * map->expected_m;
    const bool useless = far_off || max_tags_lost(map);
    if (report->lens.fault != LENS_FITS && (report->lens.gross || useless))
        return fail(ERR_INPUT,
                    "%s, and such a map is of no use: calibrate the lens, or use the calibration.json that belongs to "
                    "these pictures%s",
                    lens_verdict_text(&report->lens, text),
                    map->tag_count ? "; leave the list of tags as it is until then" : "");
    if (report->depth_ratio > MAX_RATIO || (report->depth_ratio > 0 && report->depth_ratio < 1 / MAX_RATIO))
        return refuse_unit(report->depth_ratio);
    if (map->tag_count && far_off)
        return fail(ERR_INPUT,
                    "depth and tags contradict each other by %.0f mm: the depth pictures are not of the same view and "
                    "time as the colour pictures, or not on their pixels",
                    map->rms_m * 1e3);
    return OK;
}

// ---------------------------------------------------------------- map advice

static void add_advice_line(struct map_advice *out, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void add_advice_line(struct map_advice *out, const char *format, ...)
{
    va_list list;
    if (out->count >= MAP_ADVICE_LINES)
        return;
    va_start(list, format);
    vsnprintf(out->line[out->count++], sizeof out->line[0], format, list);
    va_end(list);
}

// The first tag with too few observations to check its pose; NULL: none.
static const struct place_tag *rarely_observed(const struct place *place)
{
    enum { MIN_OBSERVATIONS = 3 };
    for (int32_t i = 0; i < place->tag_count; i++)
        if (place->tags[i].observations < MIN_OBSERVATIONS)
            return &place->tags[i];
    return NULL;
}

// The tag that fits clearly worse than the others; NULL: none. *others_px: how well those fit.
static const struct place_tag *worst_fit(const struct place *place, double *others_px)
{
    // Chosen on the tests' small world, where a side that is 5 % wrong gives 4.6 times the others' residual and right
    // ones up to 1.4 times; real films were left out.
    enum { MIN_TAGS = 4, MIN_OBSERVATIONS = 3 };
    const double times = 3, min_px = 0.1;
    const struct place_tag *worst = NULL;
    double sum = 0;
    int count = 0;
    for (int32_t i = 0; i < place->tag_count; i++) {
        const struct place_tag *tag = &place->tags[i];
        if (tag->observations < MIN_OBSERVATIONS)
            continue;
        sum += tag->rms_px;
        count++;
        worst = !worst || tag->rms_px > worst->rms_px ? tag : worst;
    }
    if (count < MIN_TAGS)
        return NULL;
    *others_px = (sum - worst->rms_px) / (count - 1);
    return worst->rms_px > min_px && worst->rms_px > times * *others_px ? worst : NULL;
}

static void say_worst_fit(const struct place *place, struct map_advice *out)
{
    double others_px;
    const struct place_tag *worst = worst_fit(place, &others_px);
    if (worst)
        add_advice_line(
            out,
            "tag %d fits to %.2f pixels only, the others to %.2f: measure its black square, which the list says is "
            "%.3f m "
            "wide, and see that it hangs flat and firmly",
            (int)worst->id, worst->rms_px, others_px, worst->side_m);
}

static void say_side(const struct mapper_report *report, struct map_advice *out)
{
    if (report->all_wrong_side)
        add_advice_line(
            out,
            "by the sensor's depth most tags are not as wide as the list says: tag %d looks "
            "%.3f m wide, the list says %.3f m; measure the black squares, correct the list and map "
            "again, else the place has the wrong scale; if they are right, the depth's unit is %.2f times too large",
            (int)report->first_wrong, report->measured_m, report->listed_side_m,
            report->measured_m / report->listed_side_m);
    else
        add_advice_line(out,
                        "tag %d looks %.3f m wide, the list says %.3f m; %s left out: measure the black square, "
                        "correct the list and map again",
                        (int)report->first_wrong, report->measured_m, report->listed_side_m,
                        report->tags_wrong_side > 1 ? "it and others like it are" : "it is");
}

static void say_lens(const struct place *place, const struct mapper_report *report, struct map_advice *out)
{
    char text[LENS_TEXT_BYTES];
    if (report->lens.fault != LENS_FITS)
        add_advice_line(out, "%s: calibrate the lens and map again%s", lens_verdict_text(&report->lens, text),
                        place->tag_count ? ", before you change anything about the tags" : "");
}

static void say_tags(const struct mapper_report *report, struct map_advice *out)
{
    if (report->tags_unseen)
        add_advice_line(out, "tag %d%s listed but in no picture; film it too, or take it off the list",
                        (int)report->first_unseen, report->tags_unseen > 1 ? " and others are" : " is");
    if (report->tags_disconnected)
        add_advice_line(
            out, "tag %d%s never in one picture with the other tags, and left out; film it together with one of them",
            (int)report->first_disconnected, report->tags_disconnected > 1 ? " and others are" : " is");
    if (report->tags_unlisted)
        add_advice_line(out, "tag %d%s in the pictures but not listed, and ignored; measure it and list it",
                        (int)report->first_unlisted, report->tags_unlisted > 1 ? " and others are" : " is");
    if (report->tags_outlier)
        add_advice_line(out,
                        "tag %d%s in two places of the sweep, and left out: it was moved meanwhile, or two tags "
                        "have this number; hang it firmly and film again",
                        (int)report->first_outlier, report->tags_outlier > 1 ? " and others are" : " is");
    if (report->tags_wrong_side && !(report->all_wrong_side && report->lens.fault != LENS_FITS))
        say_side(report, out);
    if (report->tags_moved)
        add_advice_line(out,
                        "tag %d%s no longer where the place had it; the place has it now where it hangs, as far "
                        "as the sweep shows it beside others",
                        (int)report->first_moved, report->tags_moved > 1 ? " and others are" : " is");
}

static void write_summary(const struct place *place, struct map_advice *out)
{
    int used = snprintf(out->summary, sizeof out->summary, "%s fit to %.2f pixels",
                        place->tag_count ? "tags" : "points", place->rms_px);
    if (place->rms_m > 0)
        used +=
            snprintf(out->summary + used, sizeof out->summary - (size_t)used, ", depth to %.0f mm", place->rms_m * 1e3);
    for (int32_t i = 0; i < place->tag_count; i++) {
        const float *c = place->tags[i].covariance;
        const double sigma_m = sqrt(fmax((double)(c[15] + c[18] + c[20]), 0));
        if (sigma_m > out->worst_tag_m) {
            out->worst_tag_m = sigma_m;
            out->worst_tag = place->tags[i].id;
        }
    }
    if (out->worst_tag_m > 0)
        snprintf(out->summary + used, sizeof out->summary - (size_t)used, "; the worst tag is known to %.1f mm",
                 out->worst_tag_m * 1e3);
}

void map_advise(const struct place *place, const struct mapper_report *report, const struct sweep_trouble *trouble,
                struct map_advice *out)
{
    *out = (struct map_advice){.worst_tag = -1};
    const struct place_tag *seldom = rarely_observed(place);
    write_summary(place, out);
    if (*trouble->cut)
        add_advice_line(out, "%s: the map is of what was swept until then", trouble->cut);
    say_lens(place, report, out);
    if (report->readout_s > 0)
        add_advice_line(
            out,
            "the camera reads its pictures row by row, in %.0f ms: put \"readout_ms\": %.0f beside its lens "
            "in calibration.json, so that cameras are located by it, too",
            report->readout_s * 1e3, report->readout_s * 1e3);
    if (!place->point_count)
        add_advice_line(out, "there are no landmarks, so a camera is found only where it sees a tag; film "
                             "what can be recognised from two places");
    if (seldom)
        add_advice_line(out, "tag %d is in %d picture%s only; film it again, together with others", (int)seldom->id,
                        (int)seldom->observations, seldom->observations == 1 ? "" : "s");
    say_tags(report, out);
    if (report->lens.fault == LENS_FITS && !report->tags_wrong_side)
        say_worst_fit(place, out);
    if (!report->floor_from_depth)
        add_advice_line(
            out, "the floor is in no depth picture, so height 0 is the lowest tag or landmark; film the floor too");
    if (report->lost_to_s > report->lost_from_s)
        add_advice_line(out,
                        "the sensor could not be located from %.1f s to %.1f s of the sweep; film that part again, "
                        "more slowly, with more of what was seen before in sight",
                        report->lost_from_s, report->lost_to_s);
    if (trouble->damaged)
        add_advice_line(out, "%lld damaged pictures were left out", (long long)trouble->damaged);
}
