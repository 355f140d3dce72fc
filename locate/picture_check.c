#include "locate/picture_check.h"

#include "locate/landmark_matching.h"
#include "locate/relocalization.h"
#include "locate/tag_corners.h"
#include "locate/tag_model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- lens verdict

// Less is no fault. A focal length 2 % off puts a wall at 4 m 8 cm away; lenses that are calibrated with care, maps of
// them and the fit itself differ by up to 1 %. The principal point's error is mostly taken for a turn of the camera.
// Chosen on films of the tests' small world with right and wrong lenses; other rooms and real films were left out.
static const double FOCAL = 0.02, STRETCHED = 0.03, CENTRE = 0.02, BENT = 0.03;
static const double SURE_SIGMA = 4;
// From here on the pictures show another lens, or are processed ones, and distances from them are off by as much.
static const double GROSS = 0.12, GROSS_CENTRE = 0.15;
// A lens that bends by so much, and at least by this share of how far the focal length is off, both in units of the
// bounds above, is named for that: a focal length makes up for a part of it.
static const double SURELY_BENT = 0.05, BENT_SHARE = 0.5;

struct judged {
    double by, sigma, least;
};

static bool is_fault(const struct judged *judged)
{
    return fabs(judged->by) > judged->least && fabs(judged->by) > SURE_SIGMA * judged->sigma;
}

void lens_judge(const struct ba_lens *fitted, const struct lens *given, struct lens_verdict *out)
{
    const double *c = fitted->covariance;
    const double wide = 0.5 * given->width / given->fx, high = 0.5 * given->height / given->fy;
    const double mean = (fitted->focal[0] + fitted->focal[1]) / 2, corner = wide * wide + high * high;
    const double sigma_focal = sqrt(fmax(c[0] + c[6] + 2 * c[1], 0)) / 2,
                 sigma_apart = sqrt(fmax(c[0] + c[6] - 2 * c[1], 0));
    const struct judged all[] = {
        [LENS_FOCAL] = {1 / mean - 1, sigma_focal / (mean * mean), FOCAL},
        [LENS_STRETCHED] = {fitted->focal[1] / fitted->focal[0] - 1, sigma_apart / mean, STRETCHED},
        [LENS_CENTRE] = {hypot(fitted->shift[0] / wide, fitted->shift[1] * given->fy / given->fx / wide) / 2,
                         sqrt(fmax(fmax(c[12], c[18]), 0)) / wide / 2, CENTRE},
        [LENS_BENT] = {fitted->bend * corner, sqrt(fmax(c[24], 0)) * corner, BENT},
    };
    enum lens_fault worst = LENS_FITS;
    for (enum lens_fault f = LENS_FOCAL; f <= LENS_BENT; f++)
        if (is_fault(&all[f]) &&
            (worst == LENS_FITS || fabs(all[f].by) / all[f].least > fabs(all[worst].by) / all[worst].least))
            worst = f;
    if (worst == LENS_FOCAL && is_fault(&all[LENS_BENT]) && fabs(all[LENS_BENT].by) > SURELY_BENT &&
        fabs(all[LENS_BENT].by) / BENT > BENT_SHARE * fabs(all[LENS_FOCAL].by) / FOCAL)
        worst = LENS_BENT;
    *out = (struct lens_verdict){.fault = worst};
    if (worst == LENS_FITS)
        return;
    out->by = all[worst].by;
    out->sigma = all[worst].sigma;
    out->gross = fabs(out->by) > (worst == LENS_CENTRE ? GROSS_CENTRE : GROSS);
}

const char *lens_verdict_text(const struct lens_verdict *verdict, char out[LENS_TEXT_BYTES])
{
    char by[64];
    const double percent = 100 * fabs(verdict->by);
    if (verdict->gross || !(verdict->sigma > 0)) // a fit from so far away falls short
        snprintf(by, sizeof by, "at least %.0f %%", percent);
    else
        snprintf(by, sizeof by, "%.1f %% (± %.1f %%)", percent, fmax(100 * verdict->sigma, 0.1));
    switch (verdict->fault) {
    case LENS_FOCAL:
        snprintf(out, LENS_TEXT_BYTES, "the calibrated focal length looks %s too %s", by,
                 verdict->by > 0 ? "long" : "short");
        break;
    case LENS_STRETCHED:
        snprintf(out, LENS_TEXT_BYTES, "the pictures look %s %s than the calibrated lens takes them", by,
                 verdict->by < 0 ? "lower" : "higher");
        break;
    case LENS_CENTRE:
        snprintf(out, LENS_TEXT_BYTES, "the calibrated principal point looks off by %s of the picture's width", by);
        break;
    case LENS_BENT:
        snprintf(out, LENS_TEXT_BYTES,
                 "the pictures bend straight lines otherwise than the calibrated lens, by %s at their corners", by);
        break;
    default: *out = 0;
    }
    return out;
}

// ---------------------------------------------------------------- picture check

// All chosen by hand.
enum {
    MAX_SAMPLES = 16,
    MAX_MATCHES = 300, // of one picture, those that differ by the fewest bits
    ENOUGH = 20,       // landmarks that agree on one pose: chance gives three or four, see relocalization.c
    LENS_IMAGES = 3,   // pictures, and landmarks in all of them, that a lens can be fitted to
    LENS_MATCHES = 90,
    FIT_ROUNDS = 4,
    FIT_ITERATIONS = 20,
};
static const double AGREE_PX = 4;        // at the finest pyramid level
static const double FIRST_AGREE_PX = 12; // about a lens of the ladder
// Errors that a map has as a whole, as shares: of the lens that mapped it, of its depth. Where all pictures were taken
// from about one place, landmarks at one side of it err together. Chosen on films of the tests' small world, where the
// lens fitted to right pictures is up to 1.5 % off, from one place 5 %; other rooms and real films were left out.
static const double COMMON_ERROR = 0.007, COMMON_ERROR_STANDING = 0.02;
static const double WALKED_M = 1;          // from one place: all within this of the first, or few pictures
static const double OTHER_LENS_GAIN = 1.3; // so many times as many must agree with another lens of the ladder
static const double BLACK = 20, BAR_SHARE = 0.02, SATURATED = 250, MUCH = 0.3, DARK_MEAN = 16;

// Which landmarks one picture shows, whatever the lens.
struct sample {
    struct feature features[MAX_MATCHES];
    struct landmark_match matches[MAX_MATCHES];
    int count;
    int mirrored;       // landmarks that agree in a mirror, or tags; 0: not looked for, or too few
    bool is_recognised; // as it is, by landmarks or tags
    double saturated_share, mean;
};

struct picture_check {
    const struct place *place;
    struct mirrored_tags *tags; // NULL: the place has none
    struct lens lens;
    uint8_t *gray;
    uint8_t *row_max, *column_max; // over all samples
    struct sample *samples;
    int sample_count, stride, pictures;
    struct feature found[FEATURES_MAX];
    struct feature_index index; // of `found`, or of one sample's features
    struct landmark_match matches[FEATURES_MAX];
};

static enum status open_tags(struct picture_check *check)
{
    if (!check->place->tag_count)
        return OK;
    int32_t *ids = malloc((size_t)check->place->tag_count * sizeof *ids);
    if (!ids)
        return fail(ERR_MEMORY, "no memory to check the pictures");
    for (int32_t i = 0; i < check->place->tag_count; i++)
        ids[i] = check->place->tags[i].id;
    const enum status status = mirrored_tags_open(&check->tags, &check->lens, ids, check->place->tag_count);
    free(ids);
    return status;
}

enum status picture_check_open(struct picture_check **out, const struct place *place, const struct lens *lens)
{
    struct picture_check *c = calloc(1, sizeof *c);
    *out = c;
    if (!c)
        return fail(ERR_MEMORY, "no memory to check the pictures");
    c->place = place;
    c->lens = *lens;
    c->stride = 1;
    c->gray = malloc(lens_pixels(lens));
    c->row_max = calloc((size_t)lens->height, 1);
    c->column_max = calloc((size_t)lens->width, 1);
    c->samples = malloc(MAX_SAMPLES * sizeof *c->samples);
    enum status status = c->gray && c->row_max && c->column_max && c->samples
                             ? open_tags(c)
                             : fail(ERR_MEMORY, "no memory to check the pictures");
    if (status != OK)
        picture_check_close(out);
    return status;
}

void picture_check_close(struct picture_check **out)
{
    struct picture_check *c = *out;
    if (!c)
        return;
    mirrored_tags_close(&c->tags);
    free(c->gray);
    free(c->row_max);
    free(c->column_max);
    free(c->samples);
    free(c);
    *out = NULL;
}

// ---------------------------------------------------------------- looking at a picture

static struct match_query query_of(const struct picture_check *check, const struct lens *lens)
{
    return (struct match_query){
        .points = check->place->points, .point_count = check->place->point_count, .index = &check->index, .lens = lens};
}

static void measure_light(struct picture_check *check, struct sample *sample)
{
    const int width = check->lens.width, height = check->lens.height;
    double sum = 0, saturated = 0;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const uint8_t g = check->gray[(size_t)y * (size_t)width + (size_t)x];
            sum += g;
            saturated += g >= SATURATED;
            check->row_max[y] = g > check->row_max[y] ? g : check->row_max[y];
            check->column_max[x] = g > check->column_max[x] ? g : check->column_max[x];
        }
    sample->mean = sum / (double)lens_pixels(&check->lens);
    sample->saturated_share = saturated / (double)lens_pixels(&check->lens);
}

// The landmarks that the grey picture shows, best first, into check->found and check->matches. *count: how many.
static enum status recognise_landmarks(struct picture_check *check, int *count)
{
    int features = 0;
    const enum status status =
        features_detect(check->gray, check->lens.width, check->lens.height, check->found, FEATURES_MAX, &features);
    *count = 0;
    if (status != OK)
        return status;
    feature_index_build(&check->index, check->found, features, &check->lens);
    const struct match_query query = query_of(check, &check->lens);
    *count = relocalize_match(&query, check->matches, FEATURES_MAX);
    return OK;
}

// How many landmarks agree on a pose with this lens; 0: too few.
static int count_agreeing(const struct picture_check *check, const struct landmark_match *matches, int count,
                          const struct lens *lens, struct pose *pose)
{
    int inliers = 0;
    const struct match_query query = query_of(check, lens);
    return count >= ENOUGH && relocalize(&query, matches, count, NULL, pose, &inliers) && inliers >= ENOUGH ? inliers
                                                                                                            : 0;
}

// Every second sample is dropped when there are too many.
static void thin_out(struct picture_check *check)
{
    if (check->sample_count < MAX_SAMPLES)
        return;
    int kept = 0;
    for (int i = 0; i < check->sample_count; i += 2)
        check->samples[kept++] = check->samples[i];
    check->sample_count = kept;
    check->stride *= 2;
}

// The picture is not recognised by its landmarks: by its tags, or in a mirror by either?
static enum status look_in_mirror(struct picture_check *check, struct sample *sample)
{
    struct lens other = check->lens;
    struct pose pose;
    int count, tags = 0;
    enum status status = check->tags ? mirrored_tags_look_straight(check->tags, check->gray, &tags) : OK;
    if (status != OK || tags) {
        sample->is_recognised = tags > 0;
        return status;
    }
    if (check->tags)
        status = mirrored_tags_look(check->tags, check->gray, &sample->mirrored);
    if (status != OK || sample->mirrored)
        return status;
    other.cx = other.width - 1 - other.cx;
    gray_mirror(check->gray, other.width, other.height);
    status = recognise_landmarks(check, &count);
    if (status == OK)
        sample->mirrored = count_agreeing(check, check->matches, count, &other, &pose);
    return status;
}

enum status picture_check_add(struct picture_check *check, const uint8_t *color)
{
    int count;
    struct pose pose;
    if (check->pictures++ % check->stride)
        return OK;
    thin_out(check);
    struct sample *s = &check->samples[check->sample_count];
    memset(s, 0, sizeof *s);
    gray_from_rgb(color, lens_pixels(&check->lens), check->gray);
    measure_light(check, s);
    enum status status = recognise_landmarks(check, &count);
    if (status != OK)
        return status;
    s->is_recognised = count_agreeing(check, check->matches, count, &check->lens, &pose) > 0;
    s->count = count < MAX_MATCHES ? count : MAX_MATCHES;
    for (int i = 0; i < s->count; i++) {
        s->features[i] = check->found[check->matches[i].feature];
        s->matches[i] = (struct landmark_match){check->matches[i].point, i};
    }
    check->sample_count++;
    return s->is_recognised ? OK : look_in_mirror(check, s);
}

// ---------------------------------------------------------------- fitting a lens

// One lens and where the samples were taken with it.
struct hypothesis {
    struct ba_lens lens;
    struct pose pose[MAX_SAMPLES]; // camera_from_world
    bool placed[MAX_SAMPLES];
    int agree, images; // landmarks that agree in all placed samples
};

static void use_sample(struct picture_check *check, const struct sample *sample)
{
    check->index.features = sample->features;
    check->index.count = sample->count;
}

static void try_focal(struct picture_check *check, const struct lens *given, double times,
                      struct hypothesis *hypothesis)
{
    struct lens lens = *given;
    lens.fx *= times;
    lens.fy *= times;
    *hypothesis = (struct hypothesis){.lens = {.focal = {times, times}}};
    for (int i = 0; i < check->sample_count; i++) {
        use_sample(check, &check->samples[i]);
        const int agree =
            count_agreeing(check, check->samples[i].matches, check->samples[i].count, &lens, &hypothesis->pose[i]);
        hypothesis->placed[i] = agree > 0;
        hypothesis->images += agree > 0;
        hypothesis->agree += agree;
    }
}

// The landmarks of all placed samples that agree with the hypothesis, as observations on the given lens's rays. Returns
// how many.
static int32_t select_observations(const struct picture_check *check, const struct lens *given,
                                   const struct hypothesis *hypothesis, double max_px, struct ba_observation *out)
{
    int32_t count = 0;
    for (int i = 0; i < check->sample_count; i++) {
        const struct sample *s = &check->samples[i];
        for (int k = 0; hypothesis->placed[i] && k < s->count; k++) {
            const struct place_landmark *point = &check->place->points[s->matches[k].point];
            const struct vec3 ray = lens_ray(given, s->features[k].at),
                              p = pose_apply(hypothesis->pose[i], point->world);
            if (!(p.z > 0.05))
                continue;
            const double x = p.x / p.z, y = p.y / p.z, bent = 1 + hypothesis->lens.bend * (x * x + y * y);
            const double off_x = given->fx * (hypothesis->lens.focal[0] * x * bent + hypothesis->lens.shift[0] - ray.x),
                         off_y = given->fy * (hypothesis->lens.focal[1] * y * bent + hypothesis->lens.shift[1] - ray.y);
            if (!(hypot(off_x, off_y) < max_px * (double)s->features[k].scale))
                continue;
            struct ba_observation *seen = &out[count++];
            *seen = (struct ba_observation){i, s->matches[k].point, ray.x, ray.y, {0}, 0, 1};
            landmark_covariance(point, &s->features[k], given, &hypothesis->pose[i], seen->covariance);
        }
    }
    return count;
}

// Lens and poses by the landmarks that agree, which are chosen again by the better lens.
static enum status fit_lens(const struct picture_check *check, const struct lens *given, struct hypothesis *hypothesis)
{
    struct ba_camera cameras[MAX_SAMPLES];
    struct ba_observation *seen = malloc((size_t)MAX_SAMPLES * MAX_MATCHES * sizeof *seen);
    struct vec3 *points = malloc(((size_t)check->place->point_count + 1) * sizeof *points);
    enum status status = seen && points ? OK : fail(ERR_MEMORY, "no memory to check the lens");
    for (int32_t i = 0; i < check->place->point_count && status == OK; i++)
        points[i] = check->place->points[i].world;
    for (int round = 0; round < FIT_ROUNDS && status == OK; round++) {
        hypothesis->agree = select_observations(check, given, hypothesis, round ? AGREE_PX : FIRST_AGREE_PX, seen);
        for (int i = 0; i < check->sample_count; i++)
            cameras[i].camera_from_world = hypothesis->placed[i] ? hypothesis->pose[i] : POSE_IDENTITY;
        const struct ba_problem problem = {.fx = given->fx,
                                           .fy = given->fy,
                                           .lens = &hypothesis->lens,
                                           .cameras = cameras,
                                           .points = points,
                                           .observations = seen,
                                           .camera_count = check->sample_count,
                                           .point_count = check->place->point_count,
                                           .observation_count = hypothesis->agree,
                                           .held_camera = -1,
                                           .held_points = check->place->point_count,
                                           .max_iterations = FIT_ITERATIONS};
        status = bundle_adjust(&problem);
        for (int i = 0; i < check->sample_count && status == OK; i++)
            hypothesis->pose[i] = cameras[i].camera_from_world;
    }
    if (status == OK)
        hypothesis->agree = select_observations(check, given, hypothesis, AGREE_PX, seen);
    free(seen);
    free(points);
    return status;
}

// The lens of the ladder with which clearly most landmarks agree; the given one where none is better.
static void find_focal(struct picture_check *check, const struct lens *given, struct hypothesis *best)
{
    static const double LADDER[] = {0.82, 1.22, 0.67, 1.5, 0.55, 1.83, 0.45, 2.2};
    const int first = best->agree;
    for (size_t i = 0; i < COUNT_OF(LADDER); i++) {
        struct hypothesis other;
        try_focal(check, given, LADDER[i], &other);
        if (other.agree > best->agree && other.agree > OTHER_LENS_GAIN * first)
            *best = other;
    }
}

enum { WALKED_IMAGES = 8 };

static bool has_walked(const struct picture_check *check, const struct hypothesis *hypothesis)
{
    double farthest = 0;
    struct vec3 first = {0, 0, 0};
    bool any = false;
    for (int i = 0; i < check->sample_count; i++) {
        const struct vec3 at = pose_inverse(hypothesis->pose[i]).translation;
        if (!hypothesis->placed[i])
            continue;
        first = any ? first : at;
        any = true;
        farthest = fmax(farthest, v3_distance(at, first));
    }
    return farthest > WALKED_M && hypothesis->images >= WALKED_IMAGES;
}

// A landmark's error in the map is the same in all pictures that show it, so that it counts once; and the map's own.
static enum status widen_covariance(const struct picture_check *check, const struct hypothesis *hypothesis,
                                    struct ba_lens *lens)
{
    const double common = has_walked(check, hypothesis) ? COMMON_ERROR : COMMON_ERROR_STANDING;
    int distinct = 0;
    bool *seen = calloc((size_t)check->place->point_count + 1, sizeof *seen);
    if (!seen)
        return fail(ERR_MEMORY, "no memory to check the lens");
    for (int i = 0; i < check->sample_count; i++)
        for (int k = 0; hypothesis->placed[i] && k < check->samples[i].count; k++)
            seen[check->samples[i].matches[k].point] = true; // few more than agree
    for (int32_t i = 0; i < check->place->point_count; i++)
        distinct += seen[i];
    free(seen);
    for (int i = 0; i < BA_LENS_NUMBERS * BA_LENS_NUMBERS; i++)
        lens->covariance[i] *= fmax(1, (double)hypothesis->agree / fmax(1, distinct));
    for (int i = 0; i < BA_LENS_NUMBERS; i++)
        lens->covariance[i * (BA_LENS_NUMBERS + 1)] += common * common;
    return OK;
}

static enum status judge_lens(struct picture_check *check, const struct lens *given, struct picture_verdict *out)
{
    struct hypothesis best;
    int all = 0;
    try_focal(check, given, 1, &best);
    for (int i = 0; i < check->sample_count; i++)
        all += check->samples[i].count;
    if (2 * best.agree < all)
        find_focal(check, given, &best);
    out->recognised = best.images;
    if (best.images < LENS_IMAGES || best.agree < LENS_MATCHES)
        return OK;
    enum status status = fit_lens(check, given, &best);
    if (status == OK)
        status = widen_covariance(check, &best, &best.lens);
    if (status != OK)
        return status == ERR_SOLVER ? OK : status;
    for (int i = 0; i < 4; i++) // of the two focal lengths, which an uncalibrated lens has wrong together
        best.lens.covariance[i / 2 * BA_LENS_NUMBERS + i % 2] += given->focal_sigma * given->focal_sigma;
    lens_judge(&best.lens, given, &out->lens);
    return OK;
}

// ---------------------------------------------------------------- the verdict

// Whether the picture is black at both ends of a side, for a share of it, and not all over.
static bool has_bars(const uint8_t *brightest, int count)
{
    int first = 0, last = 0;
    while (first < count && brightest[first] < BLACK)
        first++;
    while (last < count && brightest[count - 1 - last] < BLACK)
        last++;
    return first < count && first > BAR_SHARE * count && last > BAR_SHARE * count;
}

enum status picture_check_judge(struct picture_check *check, const struct lens *lens, struct picture_verdict *out)
{
    int mirrored = 0, straight = 0, bright = 0, dark = 0;
    *out = (struct picture_verdict){.looked_at = check->sample_count};
    for (int i = 0; i < check->sample_count; i++) {
        mirrored += check->samples[i].mirrored > 0;
        straight += check->samples[i].is_recognised;
        bright += check->samples[i].saturated_share > MUCH;
        dark += check->samples[i].mean < DARK_MEAN;
    }
    out->overexposed = 2 * bright > check->sample_count;
    out->dark = 2 * dark > check->sample_count;
    out->mirrored = 2 * mirrored > check->sample_count || (mirrored > 1 && !straight);
    out->barred =
        check->sample_count && (has_bars(check->row_max, lens->height) || has_bars(check->column_max, lens->width));
    return check->place->point_count && !out->mirrored ? judge_lens(check, lens, out) : OK;
}

const char *picture_verdict_text(const struct picture_verdict *verdict, bool badly_placed, char out[PICTURE_TEXT_BYTES],
                                 bool *useless)
{
    char lens[LENS_TEXT_BYTES];
    *out = 0;
    *useless = verdict->mirrored || (verdict->lens.fault != LENS_FITS && verdict->lens.gross);
    if (verdict->mirrored)
        snprintf(out, PICTURE_TEXT_BYTES, "the pictures are mirrored: switch the camera's mirror off");
    else if (verdict->barred && verdict->lens.fault != LENS_FITS && verdict->lens.fault != LENS_BENT)
        snprintf(out, PICTURE_TEXT_BYTES,
                 "the pictures have black bars, and their calibration is that of another picture (%s): film without "
                 "bars, or calibrate with them",
                 lens_verdict_text(&verdict->lens, lens));
    else if (verdict->lens.fault != LENS_FITS)
        snprintf(out, PICTURE_TEXT_BYTES,
                 "%s: calibrate the camera, or use the calibration.json that belongs to these pictures",
                 lens_verdict_text(&verdict->lens, lens));
    else if (badly_placed && verdict->overexposed)
        snprintf(out, PICTURE_TEXT_BYTES, "the pictures are overexposed: film with a shorter exposure");
    else if (badly_placed && verdict->dark)
        snprintf(out, PICTURE_TEXT_BYTES, "the pictures are too dark: film with more light or a longer exposure");
    return out;
}
