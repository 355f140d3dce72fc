#include "objects/thing_recognition.h"

#include "base/linear_algebra.h"
#include "base/portable_math.h"
#include "objects/thing_map.h"

#include <stdlib.h>
#include <string.h>

// Chosen by hand. SPAN_PX: how many pixels a thing spans at the level of the first check. VARIANTS: turns about the two
// axes of the picture that are tried, radians.
#define SPAN_PX      26.0
#define TILT         0.5
#define SAME_PLACE   0.25 // of its size: hypotheses of one place
#define COARSE_SCORE 0.45
enum { CHECK_POINTS = 160, COARSE_POINTS = 350, COARSE_STEPS = 12, FINE_STEPS = 10, MAX_HYPOTHESES = 8000 };

struct recognizer {
    const struct thing_list *things;
    struct thing_model *models;
    struct recognition_options options;
};

static const double MIN_SCORE = 0.8, MIN_VISIBLE = 0.6; // of a sighting, in each view
// thing_align.h. Tint: daylight against lamplight after a camera's white balance. The factor was chosen on the flat
// things of data set `desk`.
static const double MAX_TINT = 1.4, VARIANCE_FACTOR = 144;

struct recognition_options recognition_default_options(void)
{
    return (struct recognition_options){.nearest_m = 0.15, .farthest_m = 4, .kept = 6};
}

enum status recognizer_open(struct recognizer **out, const struct thing_list *things,
                            const struct recognition_options *options)
{
    struct recognizer *r = calloc(1, sizeof *r);
    *out = NULL;
    if (!r || !(r->models = calloc((size_t)things->count, sizeof *r->models))) {
        free(r);
        return fail(ERR_MEMORY, "no memory for %d things", things->count);
    }
    r->things = things;
    r->options = options ? *options : recognition_default_options();
    enum status status = OK;
    for (int i = 0; i < things->count && status == OK; i++)
        status = thing_model_make(&things->things[i], &r->models[i]);
    *out = r;
    if (status != OK)
        recognizer_close(out);
    return status;
}

void recognizer_close(struct recognizer **recognizer)
{
    if (!*recognizer)
        return;
    for (int i = 0; i < (*recognizer)->things->count; i++)
        thing_model_free(&(*recognizer)->models[i]);
    free((*recognizer)->models);
    free(*recognizer);
    *recognizer = NULL;
}

struct hypothesis {
    struct alignment pose;
    double score;
    int view;
};

static double diagonal_m(const struct thing *thing)
{
    return sqrt(thing->width_m * thing->width_m + thing->height_m * thing->height_m);
}

static double mean_focal_length(const struct lens *lens) { return (lens->fx + lens->fy) / 2; }

// The pyramid level at which the thing's smaller side spans about `span` pixels.
static int level_for(const struct thing *thing, const struct thing_view *view, double depth_m, double span)
{
    double size = mean_focal_length(&view->lens) / depth_m *
                  (thing->width_m < thing->height_m ? thing->width_m : thing->height_m);
    int level = 0;
    while (level + 1 < VIEW_LEVELS && size >= 1.5 * span) {
        size /= 2;
        level++;
    }
    return level;
}

// Depth of the thing in a view.
static double depth_in(const struct thing_view *view, const struct alignment *alignment)
{
    return pose_apply(view->camera_from_left, alignment->left_from_thing.translation).z;
}

// What thing_sample needs for an image level.
static double px_per_metre(const struct thing_view *view, double depth_m, int level)
{
    return mean_focal_length(&view->lens) / depth_m / (1 << level);
}

// The pose that one match means: the thing upright against the line of sight, turned and as far away as the match says.
static bool pose_from_match(const struct recognizer *recognizer, int thing, const struct thing_view *view,
                            const struct thing_match *match, struct alignment *out)
{
    const struct thing_model *model = &recognizer->models[thing];
    const double turn = match->scene->angle - match->model->angle,
                 scale = (double)match->scene->size_px / match->model->size_px;
    const double c = portable_cos(turn), s = portable_sin(turn);
    const double dx = scale * (model->scale[THING_FLAT].x - match->model->at.x),
                 dy = scale * (model->scale[THING_FLAT].y - match->model->at.y);
    const struct pixel middle = {match->scene->at.x + c * dx - s * dy, match->scene->at.y + s * dx + c * dy};
    const double depth = mean_focal_length(&view->lens) * model->scale[THING_FLAT].metres_per_px / scale;
    if (!(depth >= recognizer->options.nearest_m && depth <= recognizer->options.farthest_m) || middle.x < 0 ||
        middle.y < 0 || middle.x > view->lens.width - 1 || middle.y > view->lens.height - 1)
        return false;
    const struct vec3 ray = lens_ray(&view->lens, middle);
    const struct quat roll = quat_from_rotation_vector(v3(0, 0, turn));
    const struct pose camera_from_thing = {quat_multiply(quat_between(v3(0, 0, 1), v3_unit(ray)), roll),
                                           v3_scale(ray, depth)};
    *out =
        (struct alignment){.left_from_thing = pose_multiply(pose_inverse(view->camera_from_left), camera_from_thing)};
    return true;
}

static bool same_place(const struct thing *thing, const struct alignment *a, const struct alignment *b)
{
    const struct vec3 p = a->left_from_thing.translation, q = b->left_from_thing.translation;
    const double size = SAME_PLACE * diagonal_m(thing);
    // along the line of sight a hypothesis is less certain
    return fabs(p.x / p.z - q.x / q.z) * p.z < size && fabs(p.y / p.z - q.y / q.z) * p.z < size &&
           fabs(p.z - q.z) < 0.15 * p.z && pose_angle(a->left_from_thing, b->left_from_thing) < 0.4;
}

// Keeps the best `max`, one for a place, in falling order.
static int keep_hypothesis(const struct thing *thing, struct hypothesis *best, int count, int max,
                           const struct hypothesis *hypothesis)
{
    for (int i = 0; i < count; i++)
        if (same_place(thing, &best[i].pose, &hypothesis->pose)) {
            if (hypothesis->score <= best[i].score)
                return count;
            memmove(&best[i], &best[i + 1], (size_t)(count - i - 1) * sizeof *best); // it is replaced below
            count--;
            break;
        }
    int at = count;
    while (at > 0 && best[at - 1].score < hypothesis->score)
        at--;
    if (at >= max)
        return count;
    if (count == max)
        count--;
    memmove(&best[at + 1], &best[at], (size_t)(count - at) * sizeof *best);
    best[at] = *hypothesis;
    return count + 1;
}

struct search {
    const struct recognizer *r;
    const struct thing_view *views;
    int view_count;
    struct thing_match *matches;                  // MAX_HYPOTHESES
    struct thing_samples *check[VIEW_LEVELS * 8]; // by distance: made when first needed
    struct thing_samples *samples;                // scratch
    struct hypothesis *best;                      // options.kept
};

// Samples for the first check, shared by hypotheses of about the same size in the image: in steps of a quarter octave.
static const struct thing_samples *check_samples(struct search *search, int thing, double per_metre)
{
    const struct thing_model *m = &search->r->models[thing];
    double size = per_metre * m->scale[THING_FLAT].metres_per_px; // image pixels for one of the picture
    int slot = 0;
    while (size < 0.84 && slot + 1 < (int)COUNT_OF(search->check)) {
        size *= 1.189207115;
        slot++;
    }
    if (!search->check[slot] && (search->check[slot] = malloc(sizeof *search->check[slot])))
        thing_sample(m, per_metre, CHECK_POINTS, search->check[slot]);
    return search->check[slot];
}

static void forget_samples(struct search *search)
{
    for (size_t i = 0; i < COUNT_OF(search->check); i++) {
        free(search->check[i]);
        search->check[i] = NULL;
    }
}

static enum status find_hypotheses(struct search *search, int thing, int *count)
{
    const struct thing *t = &search->r->things->things[thing];
    *count = 0;
    for (int view = 0; view < search->view_count; view++) {
        const struct thing_view *v = &search->views[view];
        const int n = thing_matches(&search->r->models[thing], v, search->matches, MAX_HYPOTHESES);
        for (int i = 0; i < n; i++) {
            struct hypothesis h = {.view = view};
            if (!pose_from_match(search->r, thing, v, &search->matches[i], &h.pose))
                continue;
            const double depth = depth_in(v, &h.pose);
            const int level = level_for(t, v, depth, SPAN_PX);
            const struct thing_samples *samples = check_samples(search, thing, px_per_metre(v, depth, level));
            if (!samples)
                return fail(ERR_MEMORY, "no memory to look for '%s'", t->name);
            const struct align_input in = {samples, THING_FLAT, search->views, search->view_count, level, {0, 0.05}, 1};
            h.score = thing_score(&in, view, &h.pose);
            if (h.pose.visible[view] >= MIN_VISIBLE)
                *count = keep_hypothesis(t, search->best, *count, search->r->options.kept, &h);
        }
    }
    return OK;
}

static double min_score(const struct alignment *alignment, int views)
{
    double min = 1;
    for (int i = 0; i < views; i++)
        min = alignment->score[i] < min ? alignment->score[i] : min;
    return min;
}

static double min_visible(const struct alignment *alignment, int views)
{
    double min = 1;
    for (int i = 0; i < views; i++)
        min = alignment->visible[i] < min ? alignment->visible[i] : min;
    return min;
}

// The pose turned about its own x and y axes, by radians.
static struct alignment tilt_alignment(const struct alignment *alignment, double x, double y)
{
    struct alignment out = *alignment;
    out.left_from_thing.rotation =
        quat_multiply(alignment->left_from_thing.rotation, quat_from_rotation_vector(v3(x, y, 0)));
    return out;
}

// One turn tried from coarse to the level where it is decided whether it is the thing at all.
static double align_coarse(struct search *search, int thing, const struct hypothesis *hypothesis, struct alignment *out)
{
    static const double tilts[5][2] = {{0, 0}, {0, TILT}, {0, -TILT}, {TILT, 0}, {-TILT, 0}};
    const struct thing_view *v = &search->views[hypothesis->view];
    const double depth = depth_in(v, &hypothesis->pose);
    const int level = level_for(&search->r->things->things[thing], v, depth, SPAN_PX);
    double best = -1;
    thing_sample(&search->r->models[thing], px_per_metre(v, depth, level), COARSE_POINTS, search->samples);
    for (size_t k = 0; k < COUNT_OF(tilts); k++) {
        const struct align_input in = {search->samples, THING_FLAT, search->views, search->view_count, level,
                                       {0, 0.05},       1};
        struct alignment a = tilt_alignment(&hypothesis->pose, tilts[k][0], tilts[k][1]);
        if (!thing_align(&in, COARSE_STEPS, &a))
            continue;
        const double score = min_score(&a, search->view_count);
        if (score > best) {
            best = score;
            *out = a;
        }
        if (best > 0.9)
            break;
    }
    return best;
}

// From the coarse pose to full resolution, in one shape. The size is free within what the picture tells.
static bool align_fine(const struct recognizer *recognizer, int thing, enum thing_shape shape,
                       const struct thing_view *views, int view_count, const struct size_prior *size,
                       struct thing_samples *samples, struct alignment *alignment)
{
    for (int level = level_for(&recognizer->things->things[thing], &views[0], depth_in(&views[0], alignment), SPAN_PX);
         level >= 0; level--) {
        thing_sample(&recognizer->models[thing], px_per_metre(&views[0], depth_in(&views[0], alignment), level),
                     SAMPLES_MAX, samples);
        const struct align_input in = {samples, shape, views, view_count, level, *size, VARIANCE_FACTOR};
        if (!thing_align(&in, FINE_STEPS, alignment))
            return false;
    }
    return true;
}

// The pose turned about the solid of revolution's axis, by radians; the axis stays where it is.
static struct alignment turned_about_axis(const struct thing_model *model, const struct alignment *alignment,
                                          double angle)
{
    struct alignment out = *alignment;
    const struct pose turn = {quat_from_rotation_vector(v3(0, angle, 0)), v3(0, 0, 0)};
    const struct pose axis = {{0, 0, 0, 1}, v3(0, 0, model->radius_m)},
                      back = {{0, 0, 0, 1}, v3(0, 0, -model->radius_m)};
    out.left_from_thing = pose_multiply(alignment->left_from_thing, pose_multiply(axis, pose_multiply(turn, back)));
    return out;
}

// A solid's turn about its axis hardly moves its outline, so that the flat pose can be off by more than its lettering
// repeats: several turns are tried where the thing spans about twice SPAN_PX.
static bool turn_best(const struct search *search, int thing, struct alignment *alignment)
{
    static const double turns[] = {0.2, -0.2, 0.4, -0.4, 0.6, -0.6};
    const struct thing_view *v = &search->views[0];
    const struct thing_model *m = &search->r->models[thing];
    const double depth = depth_in(v, alignment);
    const int level = level_for(&search->r->things->things[thing], v, depth, 2 * SPAN_PX);
    double best = -1;
    const struct alignment start = *alignment;
    thing_sample(m, px_per_metre(v, depth, level), COARSE_POINTS, search->samples);
    for (size_t k = 0; k < COUNT_OF(turns); k++) {
        const struct align_input in = {
            search->samples, THING_TURNED, search->views, search->view_count, level, {0, 0.05}, 1};
        struct alignment now = turned_about_axis(m, &start, turns[k]);
        if (thing_align(&in, COARSE_STEPS, &now) && min_visible(&now, search->view_count) > MIN_VISIBLE &&
            min_score(&now, search->view_count) > best) {
            best = min_score(&now, search->view_count);
            *alignment = now;
        }
    }
    return best > 0;
}

static double max_tint(const struct alignment *alignment, int views)
{
    double max = 1;
    for (int i = 0; i < views; i++)
        max = alignment->tint[i] > max ? alignment->tint[i] : max;
    return max;
}

static bool is_right(const struct recognizer *recognizer, const struct alignment *alignment, int views)
{
    return min_score(alignment, views) >= MIN_SCORE && min_visible(alignment, views) >= MIN_VISIBLE &&
           max_tint(alignment, views) <= MAX_TINT &&
           alignment->left_from_thing.translation.z >= recognizer->options.nearest_m &&
           alignment->left_from_thing.translation.z <= recognizer->options.farthest_m;
}

// From the coarse pose to the finest, in one shape. False: it does not look right.
static bool finish_alignment(struct search *search, int thing, enum thing_shape shape, struct alignment *alignment)
{
    const struct recognizer *r = search->r;
    const struct size_prior size = {0, r->models[thing].scale[shape].size_sigma};
    struct alignment other = *alignment;
    bool right = align_fine(r, thing, shape, search->views, search->view_count, &size, search->samples, alignment) &&
                 is_right(r, alignment, search->view_count);
    if (shape == THING_TURNED && turn_best(search, thing, &other) &&
        align_fine(r, thing, shape, search->views, search->view_count, &size, search->samples, &other) &&
        is_right(r, &other, search->view_count) &&
        (!right || min_score(&other, search->view_count) > min_score(alignment, search->view_count))) {
        *alignment = other;
        right = true;
    }
    return right;
}

static enum status find_thing(struct search *search, int thing, struct detection *out, bool *found)
{
    int count;
    enum status status = find_hypotheses(search, thing, &count);
    struct alignment best = {0};
    double score = -1;
    *found = false;
    for (int i = 0; i < count && status == OK && score < 0.95; i++) {
        struct alignment a;
        const double now = align_coarse(search, thing, &search->best[i], &a);
        if (now > score) {
            score = now;
            best = a;
        }
    }
    if (status != OK || score < COARSE_SCORE)
        return status;
    *out = (struct detection){.thing = thing};
    for (int shape = 0; shape < THING_SHAPES; shape++) {
        out->by[shape] = best;
        out->found[shape] = finish_alignment(search, thing, (enum thing_shape)shape, &out->by[shape]);
        *found = *found || out->found[shape];
    }
    return OK;
}

static double best_score(const struct detection *detection, int views)
{
    double best = -1;
    for (int shape = 0; shape < THING_SHAPES; shape++)
        if (detection->found[shape] && min_score(&detection->by[shape], views) > best)
            best = min_score(&detection->by[shape], views);
    return best;
}

static struct vec3 place_of(const struct detection *detection)
{
    return detection->by[detection->found[THING_FLAT] ? THING_FLAT : THING_TURNED].left_from_thing.translation;
}

// Two things cannot be in one place: the one that looks less right is dropped.
static int drop_overlapping(const struct recognizer *recognizer, struct detection *detection, int count, int views)
{
    int kept = 0;
    for (int i = 0; i < count; i++) {
        bool beaten = false;
        for (int k = 0; k < count && !beaten; k++) {
            const double reach = 0.3 *
                                 (diagonal_m(&recognizer->things->things[detection[i].thing]) +
                                  diagonal_m(&recognizer->things->things[detection[k].thing])) /
                                 2;
            beaten = k != i && v3_distance(place_of(&detection[i]), place_of(&detection[k])) < reach &&
                     best_score(&detection[k], views) > best_score(&detection[i], views);
        }
        if (!beaten)
            detection[kept++] = detection[i];
    }
    return kept;
}

enum status recognizer_find(const struct recognizer *recognizer, const struct thing_view *views, int view_count,
                            struct detection *out, int *count)
{
    struct search s = {.r = recognizer, .views = views, .view_count = view_count};
    s.matches = malloc(MAX_HYPOTHESES * sizeof *s.matches);
    s.samples = malloc(sizeof *s.samples);
    s.best = malloc(((size_t)recognizer->options.kept + 1) * sizeof *s.best);
    enum status status = s.matches && s.samples && s.best ? OK : fail(ERR_MEMORY, "no memory to look for things");
    *count = 0;
    for (int i = 0; i < recognizer->things->count && status == OK; i++) {
        bool found = false;
        status = find_thing(&s, i, &out[*count], &found);
        forget_samples(&s);
        *count += found;
    }
    if (status == OK)
        *count = drop_overlapping(recognizer, out, *count, view_count);
    free(s.matches);
    free(s.samples);
    free(s.best);
    return status;
}

// log p(residuals | turned) - log p(residuals | flat): the number of independent residuals times the log of the ratio
// of the noises that are left.
static double turned_evidence(const struct detection *detection)
{
    enum { POINTS = 1000 }; // about as many residuals are there, at every distance
    const struct alignment *flat = &detection->by[THING_FLAT], *turned = &detection->by[THING_TURNED];
    if (!detection->found[THING_FLAT] || !detection->found[THING_TURNED])
        return detection->found[THING_TURNED] ? 20 : -20;
    return POINTS / VARIANCE_FACTOR * portable_log(flat->noise / turned->noise);
}

void thing_traits_add(struct thing_traits *traits, const struct recognizer *recognizer,
                      const struct detection *detection)
{
    double covariance[ALIGN_UNKNOWNS * ALIGN_UNKNOWNS];
    traits->turned_evidence += turned_evidence(detection);
    for (int shape = 0; shape < THING_SHAPES; shape++) {
        const double sigma = recognizer->models[detection->thing].scale[shape].size_sigma;
        if (!detection->found[shape] || !invert_symmetric(detection->by[shape].information, ALIGN_UNKNOWNS, covariance))
            continue;
        const double variance = covariance[ALIGN_UNKNOWNS * ALIGN_UNKNOWNS - 1];
        const double own = 1 / variance - 1 / (sigma * sigma); // without the prior, whose mean is 0
        if (own > 0) {
            traits->size[shape].information += own;
            traits->size[shape].sum += detection->by[shape].log_scale / variance;
        }
    }
}

enum status recognizer_refine(const struct recognizer *recognizer, const struct detection *detection,
                              const struct thing_traits *traits, const struct thing_view *views, int view_count,
                              struct sighting *out)
{
    const double evidence = traits ? traits->turned_evidence : turned_evidence(detection);
    enum thing_shape shape = evidence > 0 ? THING_TURNED : THING_FLAT;
    const double sigma = recognizer->models[detection->thing].scale[shape].size_sigma;
    struct size_prior size = {0, sigma};
    struct alignment a = detection->by[detection->found[shape] ? shape : 1 - shape];
    if (traits) {
        const double information = 1 / (sigma * sigma) + traits->size[shape].information;
        size = (struct size_prior){traits->size[shape].sum / information, 1 / sqrt(information)};
        size.sigma = size.sigma < 5e-4 ? 5e-4 : size.sigma;
        struct thing_samples *samples = malloc(sizeof *samples);
        if (!samples)
            return fail(ERR_MEMORY, "no memory for the samples of a thing");
        const bool aligned = align_fine(recognizer, detection->thing, shape, views, view_count, &size, samples, &a);
        free(samples);
        if (!aligned || !is_right(recognizer, &a, view_count)) { // as it is by itself, if in the other shape
            if (detection->found[shape])
                return NOTHING;
            shape = (enum thing_shape)(1 - shape);
            a = detection->by[shape];
        }
    }
    double covariance[ALIGN_UNKNOWNS * ALIGN_UNKNOWNS];
    if (!invert_symmetric(a.information, ALIGN_UNKNOWNS, covariance))
        return NOTHING;
    const double *c = covariance + 3 * ALIGN_UNKNOWNS + 3;
    const double middle = recognizer->models[detection->thing].scale[shape].middle_sigma_m, middle2 = middle * middle;
    const struct vec3 up = quat_rotate(a.left_from_thing.rotation, v3(0, -1, 0));
    *out = (struct sighting){.thing = detection->thing,
                             .shape = shape,
                             .left_from_thing = a.left_from_thing,
                             .log_scale = a.log_scale,
                             .covariance = {c[0] + middle2, c[1], c[2], c[ALIGN_UNKNOWNS + 1] + middle2,
                                            c[ALIGN_UNKNOWNS + 2], c[2 * ALIGN_UNKNOWNS + 2] + middle2},
                             .angle = portable_atan2(up.x, -up.y),
                             .angle_sigma = sqrt(covariance[2 * ALIGN_UNKNOWNS + 2]),
                             .score = min_score(&a, view_count)};
    return OK;
}

void sighting_add_rig_error(struct sighting *sighting, const struct covariance3 *error_at_1m)
{
    const struct vec3 p = sighting->left_from_thing.translation;
    const double z = p.z, z2 = z * z;
    // straight ahead it is z^2 across and z^4 along; then the axis is turned to the line of sight
    const struct covariance3 e = *error_at_1m,
                             ahead = {e.xx * z2, e.xy * z2, e.xz * z2 * z, e.yy * z2, e.yz * z2 * z, e.zz * z2 * z2};
    const struct covariance3 there = covariance3_rotate(quat_between(v3(0, 0, 1), v3_unit(p)), &ahead);
    sighting->covariance = covariance3_add(&sighting->covariance, &there);
}
