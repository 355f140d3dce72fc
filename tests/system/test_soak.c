// The app running for long with an endless camera: memory stays flat, no
// descriptor leaks, and every image's time is measured by stage.
//
//     test_soak                         a few seconds
//     test_soak SECONDS FILE CAMERA     as long as given, with figures
#include "tests/support/test.h"

#include "app/viewer/viewer_inside.h"
#include "base/clock.h"
#include "tests/support/rehearsal.h"
#include "tests/support/work.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { WIDTH = 1280, HEIGHT = 800, MAX_FRAMES = 200000, SLOWEST = 10, REFERENCE_EACH = 8 };

// Duration of the test, seconds: some images must be drawn in every third of it.
#ifdef EMULATED
static const double PATIENCE_S = 120;
#else
static const double PATIENCE_S = 9;
#endif

// One image from arrival to display.
struct latency {
    double total_ms, ms[FRAME_STAGES];
    struct work work;        // of drawing it, independent of what else runs
    double stolen_ms;        // since the image before
    double at_s;             // since the beginning
    double take_s;           // of the take
    double resolution_scale; // of the actor
    bool placed;             // the camera was localised
};

static double resident_mib(void)
{
    long pages = 0, resident = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file) {
        if (fscanf(file, "%ld %ld", &pages, &resident) != 2)
            resident = 0;
        fclose(file);
    }
    return (double)resident * (double)sysconf(_SC_PAGESIZE) / 1048576;
}

static int descriptors(void)
{
    int count = 0;
    DIR *dir = opendir("/proc/self/fd");
    while (dir && readdir(dir))
        count++;
    if (dir)
        closedir(dir);
    return count;
}

struct soak {
    int64_t frames;
    // Maximum of memory and minimum of descriptors in the second and in the last third of the time: localising or
    // drawing an image takes some temporarily, and the camera opens a file for each; a leaked descriptor stays open in
    // all later images, so the minimum rises.
    double warm_mib, last_mib;
    int descriptors_warm, descriptors_last;
    double mean_ms[FRAME_STAGES], median_ms; // from arrival to display, from the second third on
    struct latency slowest[SLOWEST];         // of the same, the slowest first
    int64_t slow, slow_stolen;               // of the same, over twice the median; while the host took processor time
    double slowest_own_ms;                   // while it did not
    double alone_ms;                         // localising and drawing the camera's image alone, mean
    double cpu_median_ms, cpu_slowest_ms;    // processor time of drawing
    double cpu_alone_ms;                     // of the camera's image alone, mean
};

// The app and its measurements during a soak.
struct soak_run {
    struct gpu *gpu;
    struct gpu_target *target;
    struct viewer *viewer;
    struct viewer_surface surface;
    uint8_t *rgba;
    struct latency *latencies;
    int64_t count, references, last_camera_number;
    double stolen_ms;              // when the last image was presented
    double alone_ms, cpu_alone_ms; // sums
};

static int slowest_first(const void *a, const void *b)
{
    const struct latency *x = a, *y = b;
    return (x->total_ms < y->total_ms) - (x->total_ms > y->total_ms);
}

// Time to draw the camera's image alone and to wait for it, milliseconds.
static double draw_camera_alone(struct soak_run *b)
{
    struct viewer *t = b->viewer;
    const struct ui_input input = {.width_px = WIDTH, .height_px = HEIGHT, .px_per_dp = ui_px_per_dp(viewer_ui(t))};
    const struct brush brush = {viewer_ui(t), theme_of(true), NULL};
    struct view_state alone = *viewer_state(t);
    alone.presence = 0;
    int64_t began = clock_now_ns();
    EXPECT_STATUS(ui_begin(viewer_ui(t), &input), OK);
    compositor_draw(&brush, (struct ui_box){0, 0, ui_width(viewer_ui(t)), ui_height(viewer_ui(t))}, viewer_image(t),
                    &alone);
    ui_end(viewer_ui(t));
    EXPECT_STATUS(ui_draw(viewer_ui(t), b->target, 0), OK);
    EXPECT_STATUS(gpu_target_read(b->target, b->rgba), OK);
    return (double)(clock_now_ns() - began) * 1e-6;
}

// Draws the next camera image. False: there is none.
static bool draw_next(struct soak_run *b, int64_t now, struct latency *latency)
{
    struct viewer *t = b->viewer;
    const struct camera_frame *frame = viewer_camera_frame(t);
    if (!frame || frame->number == b->last_camera_number || viewer_state(t)->page != PAGE_WATCH)
        return false;
    b->last_camera_number = frame->number;
    const struct work before = work_so_far();
    EXPECT_STATUS(viewer_draw(t, &b->surface, now), OK);
    EXPECT_STATUS(gpu_target_read(b->target, b->rgba), OK); // waits for the GPU, as a display would
    viewer_presented(t, clock_now_ns());
    *latency = (struct latency){.total_ms = (double)(clock_now_ns() - frame->received_ns) * 1e-6,
                                .take_s = (double)viewer_request(t)->time_ns * 1e-9,
                                .resolution_scale = viewer_request(t)->resolution_scale};
    for (int i = 0; i < FRAME_STAGES; i++)
        latency->ms[i] = (double)frame_times_at(viewer_times(t), 0)[i];
    latency->work = work_since(&before);
    const double stolen_ms = before.stolen_ms + latency->work.stolen_ms;
    latency->stolen_ms = stolen_ms - b->stolen_ms;
    b->stolen_ms = stolen_ms;
    latency->placed = frame->placed;
    return true;
}

// Measures the reference. An image that arrived meanwhile is skipped, so that the reference does not add to its
// latency.
static void measure_reference(struct soak_run *b)
{
    const struct camera_frame *frame = viewer_camera_frame(b->viewer);
    const struct work before = work_so_far();
    b->alone_ms += draw_camera_alone(b) + (double)(frame->located_ns - frame->locating_ns) * 1e-6;
    b->cpu_alone_ms += work_since(&before).cpu_ms;
    b->references++;
    viewer_update(b->viewer, clock_now_ns());
    b->last_camera_number = viewer_camera_frame(b->viewer)->number;
}

static void measure_memory(struct soak *s, bool late)
{
    const int open_now = descriptors();
    int *fewest = late ? &s->descriptors_last : &s->descriptors_warm;
    double *most_mib = late ? &s->last_mib : &s->warm_mib;
    *most_mib = fmax(*most_mib, resident_mib());
    *fewest = *fewest && *fewest < open_now ? *fewest : open_now; // 0: not counted yet
}

static int least_work_first(const void *a, const void *b)
{
    const struct latency *x = a, *y = b;
    return (x->work.cpu_ms > y->work.cpu_ms) - (x->work.cpu_ms < y->work.cpu_ms);
}

static void sum_up(struct soak *s, struct soak_run *b)
{
    s->alone_ms = b->references ? b->alone_ms / (double)b->references : 0;
    s->cpu_alone_ms = b->references ? b->cpu_alone_ms / (double)b->references : 0;
    qsort(b->latencies, (size_t)b->count, sizeof *b->latencies, least_work_first);
    s->cpu_median_ms = b->count ? b->latencies[b->count / 2].work.cpu_ms : 0;
    s->cpu_slowest_ms = b->count ? b->latencies[b->count - 1].work.cpu_ms : 0;
    for (int64_t i = 0; i < b->count; i++)
        for (int stage = 0; stage < FRAME_STAGES; stage++)
            s->mean_ms[stage] += b->latencies[i].ms[stage] / (double)b->count;
    qsort(b->latencies, (size_t)b->count, sizeof *b->latencies, slowest_first);
    s->median_ms = b->count ? b->latencies[b->count / 2].total_ms : 0;
    for (int i = 0; i < SLOWEST && i < b->count; i++)
        s->slowest[i] = b->latencies[i];
    for (int64_t i = 0; i < b->count; i++) {
        const bool slow = b->latencies[i].total_ms > 2 * s->median_ms, stolen = b->latencies[i].stolen_ms > 0;
        s->slow += slow;
        s->slow_stolen += slow && stolen;
        if (!stolen)
            s->slowest_own_ms = fmax(s->slowest_own_ms, b->latencies[i].total_ms);
    }
}

// reference: measures the app as it is used, and at intervals the camera's image alone. Otherwise every image
// is drawn at the display's resolution, so that memory does not depend on the machine's load.
static struct soak soak(const char *file, const char *camera, double seconds, bool reference)
{
    const struct viewer_options options = {
        .file = file, .camera = camera, .refresh_hz = 60, .fixed_resolution = !reference};
    struct soak_run b = {.latencies = malloc(sizeof *b.latencies * MAX_FRAMES),
                         .rgba = malloc((size_t)WIDTH * HEIGHT * 4)};
    struct soak s = {0};
    assert_non_null(b.latencies);
    EXPECT_STATUS(gpu_open(&b.gpu), OK);
    EXPECT_STATUS(gpu_target_open(&b.target, b.gpu, WIDTH, HEIGHT), OK);
    EXPECT_STATUS(viewer_open(&b.viewer, b.gpu, &options), OK);
    b.surface = (struct viewer_surface){b.target, WIDTH, HEIGHT, 0, viewer_px_per_dp(149)};
    view_state_choose_take(viewer_state(b.viewer), 0);
    int64_t began = clock_now_ns(), length = (int64_t)(seconds * 1e9);
    for (int64_t now = began; now < began + length; now = clock_now_ns()) {
        viewer_update(b.viewer, now);
        const struct take_view *stage = viewer_take_view(b.viewer);
        if (!stage || take_view_progress(stage) < 1 ||
            !take_view_final(stage)) { // time counts from when the take is ready
            began = now;
            s.frames = 0;
        }
        bool warm = now - began > length / 3, late = now - began > 2 * length / 3;
        struct latency latency;
        if (!draw_next(&b, now, &latency)) {
            clock_sleep_until_ns(now + 1000000);
            continue;
        }
        s.frames++;
        if (!warm)
            continue;
        latency.at_s = (double)(now - began) * 1e-9;
        if (b.count < MAX_FRAMES)
            b.latencies[b.count++] = latency;
        measure_memory(&s, late);
        if (reference && s.frames % REFERENCE_EACH == 0)
            measure_reference(&b);
    }
    sum_up(&s, &b);
    free(b.latencies);
    free(b.rgba);
    viewer_close(&b.viewer);
    gpu_target_close(&b.target);
    gpu_close(&b.gpu);
    return s;
}

static void test_memory_stays_flat(void **state)
{
    (void)state;
    struct rehearsal r = rehearsal_make();
    struct soak s = soak(r.file, r.camera, PATIENCE_S, false);
    print_message("%lld pictures, %.1f MiB then %.1f, %d descriptors then %d\n", (long long)s.frames, s.warm_mib,
                  s.last_mib, s.descriptors_warm, s.descriptors_last);
    EXPECT_AT_LEAST(s.frames, 5);
    EXPECT_AT_MOST(s.last_mib, s.warm_mib * 1.05 + 4); // within seconds, caches still fill
    EXPECT_AT_MOST(s.descriptors_last, s.descriptors_warm);
    EXPECT_AT_LEAST(s.median_ms, 0.1);
    rehearsal_end(&r);
}

static void print_soak(const struct soak *s)
{
    printf("pictures      %lld\n", (long long)s->frames);
    printf("memory        %.1f MiB at most in the second third, %.1f in the last (%+.2f %%)\n", s->warm_mib,
           s->last_mib, 100 * (s->last_mib / s->warm_mib - 1));
    printf("descriptors   %d at least in the second third, %d in the last\n", s->descriptors_warm, s->descriptors_last);
    for (int i = 0; i < FRAME_STAGES; i++)
        printf("%-13s %.1f ms\n", frame_stage_names[i], s->mean_ms[i]);
    printf("arrival to display: median %.1f ms, slowest %.1f (%.1f times)\n", s->median_ms, s->slowest[0].total_ms,
           s->slowest[0].total_ms / s->median_ms);
    printf("over twice the median: %lld pictures, %lld of them while the host took processors away; "
           "slowest of the others %.1f ms (%.1f times)\n",
           (long long)s->slow, (long long)s->slow_stolen, s->slowest_own_ms, s->slowest_own_ms / s->median_ms);
    printf("locating and the camera's picture alone: %.1f ms; ratio %.2f\n", s->alone_ms, s->median_ms / s->alone_ms);
    printf("processor time of drawing: median %.1f ms, most %.1f (%.1f times); the camera's picture alone %.1f\n",
           s->cpu_median_ms, s->cpu_slowest_ms, s->cpu_slowest_ms / s->cpu_median_ms, s->cpu_alone_ms);
    for (int i = 0; i < SLOWEST; i++) {
        const struct latency *w = &s->slowest[i];
        printf("slow: %.1f ms after %.1f s, the take at %.2f s, drawn at %.2f%s; ", w->total_ms, w->at_s, w->take_s,
               w->resolution_scale, w->placed ? "" : ", its place unknown");
        printf("processor %.1f ms, waited for it %.1f, beside it %.1f, stolen %.0f, %.0f pages;", w->work.cpu_ms,
               w->work.waited_ms, w->work.other_threads_ms, w->stolen_ms, w->work.faults);
        for (int k = 0; k < FRAME_STAGES; k++)
            printf(" %s %.1f", frame_stage_names[k], w->ms[k]);
        printf("\n");
    }
}

int main(int argc, char **argv)
{
    if (argc == 4) {
        struct soak s = soak(argv[2], argv[3], atof(argv[1]), true);
        print_soak(&s);
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_memory_stays_flat)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
