// reenact compare: where two movements differ.
#include "app/commands/commands.h"
#include "base/text.h"
#include "compare/expected_take.h"
#include "compare/findings.h"
#include "compare/joint_samples.h"
#include "compare/report.h"
#include "platform/files/file.h"
#include "platform/files/png.h"
#include "reenact/render/actor_renderer.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct compare_pictures;

static void compare_pictures_close(struct compare_pictures **p);

// ---------------------------------------------------------------- compare pictures

enum { WIDTH = 330, HEIGHT = 440 };
static const double FOCAL_PX = 900;

struct compare_pictures {
    struct recording *recording;
    struct take *take;
    struct gpu *gpu;
    struct renderer *renderer;
    struct lens lens;
    int64_t first_ns; // of the comparison's time 0
    uint8_t *rgba, *ground;
};

static enum status open_take(struct compare_pictures *pictures, const char *path, const char *name)
{
    enum status status = recording_open(&pictures->recording, path);
    if (status == OK)
        status = take_open_drawn(&pictures->take, pictures->recording,
                                 name ? name : recording_take_name(pictures->recording, 0));
    if (status != OK)
        return status;
    const int64_t first = take_first_sample(pictures->take);
    if (first < 0)
        return fail(ERR_INPUT, "no person was tracked in %s", path);
    pictures->first_ns = take_entry(pictures->take, first)->time_ns;
    return OK;
}

// Prepares the take's avatar. `take` NULL: the file's only one. Errors: as recording_open, take_open, gpu_open and
// renderer_open; *out is then NULL. Main thread.
static enum status compare_pictures_open(struct compare_pictures **out, const char *path, const char *take)
{
    struct compare_pictures *p = *out = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "no memory for pictures");
    p->lens = (struct lens){.width = WIDTH,
                            .height = HEIGHT,
                            .fx = FOCAL_PX,
                            .fy = FOCAL_PX,
                            .cx = (WIDTH - 1) / 2.0,
                            .cy = (HEIGHT - 1) / 2.0};
    struct renderer_options how = renderer_default_options();
    enum status status = open_take(p, path, take);
    if (status == OK)
        status = gpu_open(&p->gpu);
    if (status == OK)
        status = renderer_open(&p->renderer, p->gpu, p->take, &p->lens, &how);
    p->rgba = malloc((size_t)WIDTH * HEIGHT * 4);
    p->ground = calloc((size_t)WIDTH * HEIGHT, 3);
    if (status == OK && (!p->rgba || !p->ground))
        status = fail(ERR_MEMORY, "no memory for pictures");
    if (status != OK)
        compare_pictures_close(out);
    return status;
}

// NULL is fine; sets *p = NULL
static void compare_pictures_close(struct compare_pictures **out)
{
    struct compare_pictures *p = *out;
    *out = NULL;
    if (!p)
        return;
    renderer_close(&p->renderer);
    gpu_close(&p->gpu);
    take_close(&p->take);
    recording_free(&p->recording);
    free(p->rgba);
    free(p->ground);
    free(p);
}

static int64_t nearest_frame(const struct compare_pictures *pictures, int64_t time_ns)
{
    int64_t best = -1, min = INT64_MAX;
    for (int64_t i = 0; i < take_frame_count(pictures->take); i++) {
        const int64_t off = llabs(take_entry(pictures->take, i)->time_ns - time_ns);
        if (off < min && take_frame_is_sample(pictures->take, i)) {
            min = off;
            best = i;
        }
    }
    return best;
}

struct person {
    struct vec3 joint[JOINT_COUNT]; // world; without a place the level camera's, z up (skeleton_track.h)
    bool known[JOINT_COUNT];
    struct vec3 left, up, middle;
    double reach_m; // of the farthest joint from the middle
};

static bool person_of(const struct compare_pictures *pictures, int64_t frame, struct person *out)
{
    const struct take_entry *entry = take_entry(pictures->take, frame);
    struct vec3 low = v3(1e9, 1e9, 1e9), high = v3(-1e9, -1e9, -1e9);
    for (int j = 0; j < JOINT_COUNT; j++) {
        out->known[j] = entry->skeleton.confidence[j] > 0;
        out->joint[j] = entry->located
                            ? pose_apply(entry->world_from_camera, entry->skeleton.joint[j])
                            : v3(entry->skeleton.joint[j].x, entry->skeleton.joint[j].z, -entry->skeleton.joint[j].y);
        if (!out->known[j])
            continue;
        const struct vec3 v = out->joint[j];
        low = v3(fmin(low.x, v.x), fmin(low.y, v.y), fmin(low.z, v.z));
        high = v3(fmax(high.x, v.x), fmax(high.y, v.y), fmax(high.z, v.z));
    }
    const bool hips = out->known[JOINT_LEFT_HIP] && out->known[JOINT_RIGHT_HIP];
    const enum joint l = hips ? JOINT_LEFT_HIP : JOINT_LEFT_SHOULDER, r = hips ? JOINT_RIGHT_HIP : JOINT_RIGHT_SHOULDER;
    out->up = v3(0, 0, 1);
    const struct vec3 across = v3_sub(out->joint[l], out->joint[r]);
    out->left = v3_unit(v3_sub(across, v3_scale(out->up, v3_dot(across, out->up))));
    out->middle = v3_mix(low, high, 0.5);
    out->reach_m = 0.5 * v3_distance(low, high);
    return out->known[l] && out->known[r] && v3_length(out->left) > 0.5;
}

// A camera before the person, turned to their left by azimuth_rad, level, so far away that they fill the picture.
static struct pose camera_before(const struct person *who, double azimuth_rad)
{
    const struct vec3 ahead = v3_cross(who->left, who->up),
                      from = v3_add(v3_scale(ahead, cos(azimuth_rad)), v3_scale(who->left, sin(azimuth_rad))),
                      z = v3_scale(from, -1), y = v3_scale(who->up, -1), x = v3_cross(y, z);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    const double away_m = FOCAL_PX * (who->reach_m + 0.1) / (0.5 * HEIGHT);
    return (struct pose){.rotation = quat_from_matrix(m), .translation = v3_add(who->middle, v3_scale(from, away_m))};
}

// The part's two joints in the picture.
static void mark_part(const struct compare_pictures *pictures, const struct person *who, struct pose world_from_camera,
                      int part, struct report_picture *out)
{
    if (part < 0 || !who->known[part_ends[part].from] || !who->known[part_ends[part].to])
        return;
    const struct pose camera_from_world = pose_inverse(world_from_camera);
    const struct pixel from = lens_project(&pictures->lens,
                                           pose_apply(camera_from_world, who->joint[part_ends[part].from])),
                       to =
                           lens_project(&pictures->lens, pose_apply(camera_from_world, who->joint[part_ends[part].to]));
    out->marked = true;
    out->from_px[0] = from.x;
    out->from_px[1] = from.y;
    out->to_px[0] = to.x;
    out->to_px[1] = to.y;
}

// The person `time_s` after the take's first skeleton, seen from azimuth_rad as report_moment says; part: marked, -1:
// none. NOTHING: no person is tracked then; *out is zeroed. ERR_DEVICE, ERR_MEMORY, ERR_CORRUPT, ERR_IO.
static enum status compare_pictures_draw(struct compare_pictures *pictures, double time_s, double azimuth_rad, int part,
                                         struct report_picture *out)
{
    struct person who;
    *out = (struct report_picture){0};
    const int64_t frame = nearest_frame(pictures, pictures->first_ns + (int64_t)(time_s * 1e9));
    if (frame < 0 || !person_of(pictures, frame, &who))
        return NOTHING;
    const struct renderer_view view = {.world_from_camera = camera_before(&who, azimuth_rad),
                                       .time_ns = take_entry(pictures->take, frame)->time_ns -
                                                  take_entry(pictures->take, 0)->time_ns,
                                       .color = pictures->ground};
    struct renderer_result result;
    enum status status = renderer_draw(pictures->renderer, &view, &result);
    if (status == OK && !result.parts)
        return NOTHING;
    if (status == OK)
        status = renderer_read_actor(pictures->renderer, pictures->rgba);
    if (status == OK)
        status =
            png_encode(&(struct png_layout){PNG_RGBA8, WIDTH, HEIGHT}, pictures->rgba, 6, &out->png, &out->png_size);
    out->width_px = WIDTH;
    out->height_px = HEIGHT;
    if (status == OK)
        mark_part(pictures, &who, view.world_from_camera, part, out);
    return status;
}

// ---------------------------------------------------------------- reenact compare

enum { MAX_ATTEMPTS = 100, MAX_WORDS = 32 };

struct named_movement {
    const char *path, *take;
};

struct compare_arguments {
    const char *reference, *take, *html, *csv;
    struct named_movement with[MAX_ATTEMPTS], further[MAX_WORDS]; // attempts; references beside the first
    int attempts, furthers;
    const char *tolerance[MAX_WORDS], *ignore[MAX_WORDS];
    int tolerances, ignores;
    double from_s, to_s; // < 0: not given
    bool json, force, figures, all, everything;
};

enum {
    KEY_TAKE = COMMAND_KEY,
    KEY_WITH,
    KEY_WITH_TAKE,
    KEY_JSON,
    KEY_HTML,
    KEY_CSV,
    KEY_FORCE,
    KEY_FIGURES,
    KEY_TOLERANCE,
    KEY_IGNORE,
    KEY_FROM,
    KEY_TO,
    KEY_REFERENCE,
    KEY_REFERENCE_TAKE,
    KEY_EVERYTHING,
    KEY_ALL
};

static const struct argp_option options[] = {
    {"take", KEY_TAKE, "NAME", 0, "the reference's take; needed where A holds several", 0},
    {"with", KEY_WITH, "B", 0, "the attempt: a recording, or joints alone as joints-csv, BVH, TRC or C3D; repeatable",
     0},
    {"with-take", KEY_WITH_TAKE, "NAME", 0, "the attempt's take; given again: one more attempt of the same recording",
     0},
    {"tolerance", KEY_TOLERANCE, "PART=DEGREES", 0,
     "how far off a part may be, like knees=20 or all=15; repeatable. This and the next five are added to what A keeps "
     "for its take (reenact-capture take expect)",
     0},
    {"ignore", KEY_IGNORE, "PART", 0, "a part of the body that does not matter, like head; repeatable", 0},
    {"from", KEY_FROM, "S", 0, "the first second of the reference that counts", 0},
    {"to", KEY_TO, "S", 0, "the last one", 0},
    {"reference", KEY_REFERENCE, "FILE", 0,
     "a further reference, which is right, too: what they differ by is the tolerance; repeatable", 0},
    {"reference-take", KEY_REFERENCE_TAKE, "NAME", 0,
     "its take; without --reference, or given again: one more of the same recording", 0},
    {"everything", KEY_EVERYTHING, NULL, 0, "leave aside what A keeps: everything counts", 0},
    {"html", KEY_HTML, "FILE", 0, "also write a page with pictures", 0},
    {"figures", KEY_FIGURES, NULL, 0, "stick figures in the page, instead of people as recorded", 0},
    {"all", KEY_ALL, NULL, 0, "print every finding, not only the three worst", 0},
    {"csv", KEY_CSV, "FILE", 0, "also write the joints' angles over time", 0},
    COMMAND_OPTION_FORCE(KEY_FORCE),
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

// Another attempt by `path`. Its take, if any, follows.
static void take_attempt(struct argp_state *state, struct compare_arguments *arguments, const char *path)
{
    if (arguments->attempts == MAX_ATTEMPTS)
        argp_error(state, "at most %d attempts can be compared together", MAX_ATTEMPTS);
    arguments->with[arguments->attempts++].path = path;
}

static void take_take(struct argp_state *state, struct compare_arguments *arguments, const char *name)
{
    if (!arguments->attempts)
        argp_error(state, "--with-take belongs to the --with before it");
    if (arguments->with[arguments->attempts - 1].take)
        take_attempt(state, arguments, arguments->with[arguments->attempts - 1].path);
    arguments->with[arguments->attempts - 1].take = name;
}

static void take_further(struct argp_state *state, struct compare_arguments *arguments, const char *path)
{
    if (arguments->furthers == MAX_WORDS)
        argp_error(state, "at most %d further references can be given", MAX_WORDS);
    arguments->further[arguments->furthers++].path = path;
}

// path NULL: the reference's own file.
static void take_further_take(struct argp_state *state, struct compare_arguments *arguments, const char *name)
{
    const int last = arguments->furthers - 1;
    if (last < 0 || arguments->further[last].take)
        take_further(state, arguments, last < 0 ? NULL : arguments->further[last].path);
    arguments->further[arguments->furthers - 1].take = name;
}

static void take_word(struct argp_state *state, const char *words[MAX_WORDS], int *count, const char *word)
{
    if (*count == MAX_WORDS)
        argp_error(state, "at most %d parts can be named", MAX_WORDS);
    words[(*count)++] = word;
}

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct compare_arguments *a = state->input;
    switch (key) {
    case KEY_TOLERANCE: take_word(state, a->tolerance, &a->tolerances, value); return 0;
    case KEY_IGNORE: take_word(state, a->ignore, &a->ignores, value); return 0;
    case KEY_FROM: a->from_s = command_parse_number(state, "--from", value, 0, 1e6); return 0;
    case KEY_TO: a->to_s = command_parse_number(state, "--to", value, 0, 1e6); return 0;
    case KEY_REFERENCE: take_further(state, a, value); return 0;
    case KEY_REFERENCE_TAKE: take_further_take(state, a, value); return 0;
    case KEY_EVERYTHING: a->everything = true; return 0;
    case KEY_TAKE: a->take = value; return 0;
    case KEY_WITH: take_attempt(state, a, value); return 0;
    case KEY_WITH_TAKE: take_take(state, a, value); return 0;
    case KEY_JSON: a->json = true; return 0;
    case KEY_HTML: a->html = value; return 0;
    case KEY_CSV: a->csv = value; return 0;
    case KEY_FIGURES: a->figures = true; return 0;
    case KEY_ALL: a->all = true; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->reference, value); return 0;
    case ARGP_KEY_END:
        command_require(state, a->reference, "A");
        command_require(state, a->attempts ? a->with[0].path : NULL, "--with");
        if (a->csv && a->attempts > 1)
            argp_error(state, "--csv takes one attempt");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// Before the work, so that it is not done in vain.
static enum status check_output(const struct compare_arguments *arguments, const char *path)
{
    if (!path)
        return OK;
    bool compared = file_is_same(path, arguments->reference);
    for (int k = 0; k < arguments->attempts; k++)
        compared = compared || file_is_same(path, arguments->with[k].path);
    for (int k = 0; k < arguments->furthers; k++)
        compared = compared || (arguments->further[k].path && file_is_same(path, arguments->further[k].path));
    if (compared)
        return fail(ERR_INPUT, "%s is what is compared; give the report another name", path);
    if (arguments->html && arguments->csv && !strcmp(arguments->html, arguments->csv))
        return fail(ERR_INPUT, "--html and --csv both name %s", path);
    return file_check_output(path, arguments->force);
}

static const char *name_of(const char *path, const char *take)
{
    const char *slash = strrchr(path, '/');
    if (take)
        return take;
    return slash ? slash + 1 : path;
}

// Everything of one run.
struct compare_run {
    const struct compare_arguments *arguments;
    const char *program;
    struct progress_bar *bar;
    struct expectation expected;
    struct comparison comparisons[MAX_ATTEMPTS];
    struct report_moment moments[MAX_ATTEMPTS][REPORT_MOMENTS];
    struct report_attempt attempts[MAX_ATTEMPTS];
};

static void print_warnings(const struct compare_run *run, const char *of, const struct movement_source *source)
{
    const char *program = run->program;
    char path[TEXT_SHOWN_BYTES];
    text_shown(of, path);
    progress_bar_end(run->bar); // its line is needed
    for (int k = 0; k < source->notes.count; k++)
        fprintf(stderr, "%s: %s: %s\n", program, path, source->notes.line[k]);
    const double tilt_deg = source->tilt_rad * 180 / 3.14159265358979323846;
    if (tilt_deg >= 3)
        fprintf(stderr, "%s: %s: the camera was tilted by %.0f degrees, as %s; corrected\n", program, path, tilt_deg,
                source->tilt_by_floor ? "the floor says" : "the person's standing says");
    if (source->clock_jumps)
        fprintf(stderr, "%s: warning: %s: the clock jumps %lld times; the jumps were closed up\n", program, path,
                (long long)source->clock_jumps);
    if (source->frames_side_mended)
        fprintf(stderr, "%s: warning: %s: left and right were confused in %lld frames; exchanged\n", program, path,
                (long long)source->frames_side_mended);
    if (source->frames_dropped)
        fprintf(stderr, "%s: warning: %s: %lld rows or frames were left out: no number, or no later time\n", program,
                path, (long long)source->frames_dropped);
}

// What the options say, beside what the reference's recording keeps.
static enum status set_expected(const struct compare_arguments *arguments, double seconds,
                                struct expectation *expectation)
{
    enum status status = OK;
    for (int i = 0; i < arguments->tolerances && status == OK; i++)
        status = expectation_set_tolerance(expectation, arguments->tolerance[i]);
    for (int i = 0; i < arguments->ignores && status == OK; i++)
        status = expectation_ignore(expectation, arguments->ignore[i]);
    if (status == OK && (arguments->from_s >= 0 || arguments->to_s >= 0)) {
        const double to_s = expectation->to_s > 0 ? expectation->to_s : -1;
        status = expectation_set_stretch(expectation, arguments->from_s >= 0 ? arguments->from_s : expectation->from_s,
                                         arguments->to_s >= 0 ? arguments->to_s : to_s, seconds);
    }
    return status;
}

static enum status add_further(struct compare_run *run, const struct movement *reference,
                               const struct named_movement *of, struct reference_spread *spread)
{
    struct movement further = {0};
    struct movement_source source;
    const char *path = of->path ? of->path : run->arguments->reference;
    char name[TEXT_SHOWN_BYTES];
    const enum status status = movement_read(path, of->take, &further, &source);
    if (status != OK)
        return status;
    print_warnings(run, path, &source);
    snprintf(name, sizeof name, of->take ? "take '%s'" : "%s", name_of(path, of->take));
    return reference_spread_add(spread, reference, &further, &run->expected, name);
}

// What counts when this is the reference, into run->expected.
static enum status expect_of_reference(struct compare_run *run, const struct movement *reference)
{
    const struct compare_arguments *a = run->arguments;
    struct expected_take kept = {.number = -1};
    struct reference_spread spread = {.references = 0};
    enum status status = OK;
    if (!a->everything && !is_joints_file(a->reference))
        status = expected_take_read(a->reference, a->take, reference, &kept);
    if (status == OK)
        status = set_expected(a, reference->count / MOVEMENT_RATE_HZ, &kept.expected);
    if (status == OK)
        status = expected_take_measure(a->reference, reference, &kept, &spread);
    run->expected = kept.expected;
    for (int k = 0; k < a->furthers && status == OK; k++)
        status = add_further(run, reference, &a->further[k], &spread);
    if (status == OK && spread.references)
        reference_spread_put(&spread, &run->expected);
    const struct movement_source notes = {.notes = kept.notes};
    if (status == OK)
        print_warnings(run, a->reference, &notes);
    return status;
}

enum { STEPS = 3 }; // of an attempt: the reference read, the attempt read, both compared

static enum status compare_attempt(struct compare_run *run, int k)
{
    const struct compare_arguments *a = run->arguments;
    struct movement_source source, reference_source;
    struct movement reference = {0}, attempt = {0};
    enum status status = movement_read(a->reference, a->take, &reference, &reference_source);
    progress_bar_step(run->bar);
    if (status == OK && !k)
        print_warnings(run, a->reference, &reference_source);
    if (status == OK && !k)
        status = expect_of_reference(run, &reference);
    if (status == OK)
        status = movement_read(a->with[k].path, a->with[k].take, &attempt, &source);
    progress_bar_step(run->bar);
    if (status == OK) {
        print_warnings(run, a->with[k].path, &source);
        status = comparison_make(&reference, &attempt, &run->expected, &run->comparisons[k]);
    }
    progress_bar_step(run->bar);
    movement_free(&reference);
    movement_free(&attempt);
    if (status == OK)
        run->attempts[k] = (struct report_attempt){
            &run->comparisons[k],
            a->attempts > 1 && !a->with[k].take ? a->with[k].path : name_of(a->with[k].path, a->with[k].take),
            run->moments[k],
            report_moments(&run->comparisons[k], run->moments[k]),
            source.began_ns,
            reference_source.began_ns};
    return status;
}

// The moments of attempts first..end - 1 as pictures of this file's take, which is their own; first -1: of the
// reference, for all of them. Where none can be made there are stick figures, and why is said once.
static void draw_moments(struct compare_run *run, const char *path, const char *take, int first, int end)
{
    struct compare_pictures *pictures = NULL;
    char shown[TEXT_SHOWN_BYTES];
    const bool of_reference = first < 0;
    int wanted = 0;
    first = first < 0 ? 0 : first;
    for (int k = first; k < end; k++)
        wanted += run->attempts[k].moment_count;
    if (!wanted || is_joints_file(path))
        return;
    enum status status = compare_pictures_open(&pictures, path, take);
    for (int k = first; k < end; k++)
        for (int n = 0; n < run->attempts[k].moment_count && status >= OK; n++) {
            struct report_moment *m = &run->moments[k][n];
            status = of_reference
                         ? compare_pictures_draw(pictures, m->reference_s, m->reference_azimuth_rad, -1, &m->reference)
                         : compare_pictures_draw(pictures, m->attempt_s, m->attempt_azimuth_rad, m->part, &m->attempt);
        }
    if (status < OK)
        fprintf(stderr, "%s: %s: %s; the page has stick figures instead\n", run->program, text_shown(path, shown),
                status_message());
    compare_pictures_close(&pictures);
}

static enum status write_reports(struct compare_run *run)
{
    const struct compare_arguments *a = run->arguments;
    enum status status = OK;
    char shown[TEXT_SHOWN_BYTES];
    if (a->html && !a->figures) {
        draw_moments(run, a->reference, a->take, -1, a->attempts);
        for (int k = 0; k < a->attempts; k++)
            draw_moments(run, a->with[k].path, a->with[k].take, k, k + 1);
    }
    if (a->html)
        status = command_write_text(a->html, report_html(run->attempts, a->attempts, name_of(a->reference, a->take)));
    if (status == OK && a->html && a->csv && file_is_same(a->html, a->csv))
        return fail(ERR_INPUT, "--csv %s is the page of --html; the page was written, the angles were not", a->csv);
    if (status == OK && a->csv)
        status = command_write_text(a->csv, report_csv(&run->comparisons[0]));
    if (status != OK)
        return status;
    if (a->json)
        return command_write_text(NULL, a->attempts == 1 ? report_json(&run->attempts[0])
                                                         : report_json_attempts(run->attempts, a->attempts));
    for (int k = 0; k < a->attempts && a->attempts > 1; k++)
        if (run->comparisons[k].relation == RELATION_SAME)
            printf("attempt %d, %s: %.0f\n", k + 1, text_shown(run->attempts[k].name, shown),
                   run->comparisons[k].score);
        else
            printf("attempt %d, %s: no score\n", k + 1, text_shown(run->attempts[k].name, shown));
    return command_write_text(NULL, report_text(&run->comparisons[a->attempts - 1], a->all));
}

int reenact_compare(int argc, char **argv)
{
    struct compare_arguments a = {.from_s = -1, .to_s = -1};
    const struct argp argp = {
        options,
        parse_option,
        "A --with B",
        "Compare the attempt B with the reference A: where they differ, in words and numbers. Both "
        "are recordings, or files of joints alone: joints-csv, BVH, TRC, C3D. Of several attempts the scores are shown "
        "in their order.",
        NULL,
        NULL,
        NULL};
    command_parse(&argp, argc, argv, &a);
    struct progress_bar bar;
    struct compare_run *r = calloc(1, sizeof *r);
    enum status status = r ? check_output(&a, a.html) : fail(ERR_MEMORY, "no memory to compare movements");
    if (status == OK)
        status = check_output(&a, a.csv);
    if (r) {
        r->arguments = &a;
        r->program = argv[0];
    }
    progress_bar_start(&bar, "comparing", (int64_t)STEPS * a.attempts);
    if (r)
        r->bar = &bar;
    for (int k = 0; k < a.attempts && status == OK; k++)
        status = compare_attempt(r, k);
    progress_bar_end(&bar);
    if (status == OK)
        status = write_reports(r);
    for (int k = 0; k < a.attempts && r; k++) {
        report_moments_free(r->moments[k], REPORT_MOMENTS);
        comparison_free(&r->comparisons[k]);
    }
    free(r);
    return status == OK ? 0 : command_failed(argv[0]);
}
