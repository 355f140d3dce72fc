// The app running on and on with a camera that never ends: memory stays flat, no
// descriptor is lost, and every picture's time is known by stage.
//
//     test_soak                         a few seconds
//     test_soak SECONDS FILE CAMERA     as long as is wished, with figures
#include "tests/test.h"

#include "app/tablet.h"
#include "platform/clock.h"
#include "tests/support/rehearsal.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { WIDTH = 1280, HEIGHT = 800, MOST_FRAMES = 200000 };

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
    // Most seen in the second and in the last third of the time: a picture that is being located, or
    // drawn, takes some for a moment.
    double settled_mib, last_mib;
    int most_descriptors_settled, most_descriptors_last;
    double median_ms, worst_ms;   // of arrival to display, from the second third on
    double alone_ms;              // locating and drawing the camera's picture alone, mean
    struct frame_times times;     // of all
};

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// The camera's picture alone, drawn and waited for.
static double draw_camera_alone(struct tablet *t, struct gpu_target *target, uint8_t *rgba)
{
    const struct ui_input input = {.width_px = WIDTH, .height_px = HEIGHT, .px_per_dp = ui_px_per_dp(t->ui)};
    const struct brush brush = {t->ui, theme_of(true)};
    struct show alone = t->show;
    alone.presence = 0;
    int64_t began = clock_now_ns();
    EXPECT_STATUS(ui_begin(t->ui, &input), OK);
    scene_draw(&brush, (struct ui_box){0, 0, ui_width(t->ui), ui_height(t->ui)}, &t->picture, &alone);
    ui_end(t->ui);
    EXPECT_STATUS(ui_draw(t->ui, target, 0), OK);
    EXPECT_STATUS(gpu_target_read(target, rgba), OK);
    return (double)(clock_now_ns() - began) * 1e-6;
}

// reference: measures the app as it is used, and the camera's picture alone beside it. Else every picture is
// drawn at the display's size, for what memory is needed must not hang on how busy the machine is.
static struct soak soak(const char *file, const char *camera, double seconds, bool reference)
{
    const struct tablet_options how = {.file = file, .camera = camera, .refresh_hz = 60, .fixed_fineness = !reference};
    struct tablet_glass glass = {NULL, WIDTH, HEIGHT, 0, tablet_px_per_dp(149)};
    struct tablet t;
    struct gpu *gpu;
    struct gpu_target *target;
    struct soak s = {0};
    double *totals = malloc(sizeof *totals * MOST_FRAMES);
    uint8_t *rgba = malloc((size_t)WIDTH * HEIGHT * 4);
    int64_t counted = 0, references = 0;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(gpu_target_open(&target, gpu, WIDTH, HEIGHT, 1), OK);
    EXPECT_STATUS(tablet_open(&t, gpu, &how), OK);
    glass.target = target;
    show_choose(&t.show, 0);
    int64_t began = clock_now_ns(), length = (int64_t)(seconds * 1e9), last_sight = 0;
    for (int64_t now = began; now < began + length; now = clock_now_ns()) {
        tablet_update(&t, now);
        if (!t.stage || stage_prepared(t.stage) < 1 || !stage_settled(t.stage)) { // it counts from when the take is prepared
            began = now;
            s.frames = 0;
        }
        bool settled = now - began > length / 3, late = now - began > 2 * length / 3;
        if (!t.sight || t.sight->number == last_sight || t.show.page != PAGE_WATCH) {
            clock_sleep_until_ns(now + 1000000);
            continue;
        }
        last_sight = t.sight->number;
        EXPECT_STATUS(tablet_draw(&t, &glass, now), OK);
        EXPECT_STATUS(gpu_target_read(target, rgba), OK); // as a display would have to wait for it
        tablet_shown(&t, clock_now_ns());
        double total = (double)(clock_now_ns() - t.sight->came_ns) * 1e-6;
        if (settled && counted < MOST_FRAMES)
            totals[counted++] = total;
        int open_now = descriptors(), *most = late ? &s.most_descriptors_last : &s.most_descriptors_settled;
        double resident = resident_mib(), *most_mib = late ? &s.last_mib : &s.settled_mib;
        if (settled)
            *most_mib = fmax(*most_mib, resident);
        if (settled && open_now > *most)
            *most = open_now;
        if (reference && settled) {
            s.alone_ms += draw_camera_alone(&t, target, rgba) + (double)(t.sight->located_ns - t.sight->locating_ns) * 1e-6;
            references++;
        }
        s.frames++;
    }
    s.times = t.times;
    s.alone_ms /= references ? (double)references : 1;
    qsort(totals, (size_t)counted, sizeof *totals, ascending);
    s.median_ms = counted ? totals[counted / 2] : 0;
    s.worst_ms = counted ? totals[counted - 1] : 0;
    free(totals);
    free(rgba);
    tablet_close(&t);
    gpu_target_close(&target);
    gpu_close(&gpu);
    return s;
}

static void test_memory_stays_flat(void **state)
{
    (void)state;
    struct rehearsal r = rehearsal_make();
    struct soak s = soak(r.file, r.camera, 9, false);
    print_message("%lld pictures, %.1f MiB then %.1f, %d descriptors then %d\n", (long long)s.frames, s.settled_mib,
                  s.last_mib, s.most_descriptors_settled, s.most_descriptors_last);
    EXPECT_AT_LEAST(s.frames, 5);
    EXPECT_AT_MOST(s.last_mib, s.settled_mib * 1.05 + 4); // in seconds, caches still fill
    EXPECT_AT_MOST(s.most_descriptors_last, s.most_descriptors_settled);
    EXPECT_AT_LEAST(s.median_ms, 0.1);
    rehearsal_end(&r);
}

static void say(const struct soak *s)
{
    printf("pictures      %lld\n", (long long)s->frames);
    printf("memory        %.1f MiB at most in the second third, %.1f in the last (%+.2f %%)\n", s->settled_mib, s->last_mib,
           100 * (s->last_mib / s->settled_mib - 1));
    printf("descriptors   %d at most in the second third, %d in the last\n", s->most_descriptors_settled,
           s->most_descriptors_last);
    for (int i = 0; i < FRAME_STAGES; i++)
        printf("%-13s %.1f ms\n", frame_stage_names[i], s->times.sum_ms[i] / (double)s->times.frames);
    printf("arrival to display: median %.1f ms, slowest %.1f (%.1f times)\n", s->median_ms, s->worst_ms,
           s->worst_ms / s->median_ms);
    printf("locating and the camera's picture alone: %.1f ms; ratio %.2f\n", s->alone_ms, s->median_ms / s->alone_ms);
}

int main(int argc, char **argv)
{
    if (argc == 4) {
        struct soak s = soak(argv[2], argv[3], atof(argv[1]), true);
        say(&s);
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_memory_stays_flat)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
