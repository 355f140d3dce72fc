// Every screen, on screens from that of a telephone to that of a desk and with text of every size: no control and no
// text is cut, under another control, or too small for a finger, except inside of what scrolls; and all that scrolls
// can be brought into sight. The rectangles are those that the screens laid out.
//
//     test_screens_fit          the tests
//     test_screens_fit FOLDER   pictures of them, too
#include "tests/support/test.h"

#include "app/studio/studio_screen.h"
#include "app/ui/screen_live.h"
#include "app/viewer/viewer.h"
#include "platform/files/png.h"
#include "reenact/render/shaders.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct glass_size {
    int width, height;
    double dpi;
};
// The last one is as small as `--size` allows.
static const struct glass_size sizes[] = {{1024, 600, 170}, {800, 480, 133},  {480, 800, 133},
                                          {1280, 800, 149}, {800, 1280, 149}, {1280, 720, 96},
                                          {720, 1280, 160}, {320, 480, 96},   {480, 320, 96}};
static const double finger_mm = 9;

static struct {
    struct gpu *gpu;
    struct gpu_target *target;
    struct ui *ui;
    const char *folder; // NULL: no pictures
    struct glass_size size;
    double px_per_dp;
    struct screens screens;
    struct view_state state;
    struct studio_state studio;
    struct ui_input input;
    struct scroll scroll; // of the studio's page
    int bad;              // faults found on the screens of a test
} t;

// ---------------------------------------------------------------- what the screens show

static const char *const long_name = "Übung mit dem schweren Ball für die Schulter und den Rücken, dritte Woche";
static const char *const japanese = "空手の形・平安初段・二千二十六年十一月の稽古";

static struct comparison comparison;
static struct finding findings[30];
static uint8_t strip[64][PART_COUNT];
static struct take_view_image image;
static enum verdict verdicts[PART_COUNT];
static struct part_difference differences[PART_COUNT];
static struct live_page live_page;
static struct room_page room_page;
static struct room_thing things[40];
static struct thing_card card;
static struct take_card cards[9];
static struct frame_times times;
static struct studio_snapshot snapshot;
static struct source_device devices[12];

static void make_content(void)
{
    for (int i = 0; i < 30; i++) {
        findings[i] = (struct finding){
            .kind = (enum finding_kind)(i % 3), .part = "right_forearm", .from_s = 0.2 * i, .to_s = 0.2 * i + 0.4};
        snprintf(findings[i].sentence, sizeof findings[i].sentence,
                 i % 3 ? "Right knee %d° less bent, from %.1f s to %.1f s"
                       : "Finding %d: the right forearm was held further out than the actor's while the arms went up, "
                         "from %.1f s to %.1f s",
                 i, 0.2 * i, 0.2 * i + 0.4);
        findings[i].loss = 30 - i;
    }
    comparison = (struct comparison){.findings = findings, .finding_count = 30, .score = 74};
    for (int cell = 0; cell < 64; cell++)
        for (int p = 0; p < PART_COUNT; p++)
            strip[cell][p] = (uint8_t)((cell / 8 + p) % 3);
    for (int p = 0; p < PART_COUNT; p++) {
        verdicts[p] = p == PART_LEFT_UPPER_ARM ? VERDICT_DIFFERENT : VERDICT_SAME;
        differences[p] = (struct part_difference){.verdict = verdicts[p], .angle_rad = 1.93};
    }
    image = (struct take_view_image){.lens = {.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 320, .cy = 240},
                                     .world_from_camera = POSE_IDENTITY};
    live_page = (struct live_page){.file = "film.reenact",
                                   .take = long_name,
                                   .image = &image,
                                   .verdicts = verdicts,
                                   .parts = differences,
                                   .person_ns = -1,
                                   .strip = (const uint8_t(*)[PART_COUNT])strip,
                                   .strip_cells = 64};
    for (int i = 0; i < 40; i++)
        things[i] = (struct room_thing){
            .name = i % 2 ? japanese : "Dumbbell, 2.5 kg", .world_from_thing = POSE_IDENTITY, .gone = i % 5 == 0};
    card = (struct thing_card){.name = "Dumbbell, 2.5 kg",
                               .description = "A pair of dumbbells with a rubber coat, for exercises of the shoulder.",
                               .weight = "2.5 kg",
                               .material = "cast iron, rubber",
                               .instructions = "Hold it with the thumb round the bar. Lift it slowly, at most to the "
                                               "height of the shoulder, and breathe out meanwhile. Ten times a side.",
                               .note = japanese,
                               .source = "Kept in the recording."};
    room_page = (struct room_page){.things = things, .count = 40, .card = &card};
    for (int i = 0; i < 9; i++)
        cards[i] = (struct take_card){.name = i == 1   ? japanese
                                              : i == 2 ? long_name
                                                       : "exercise",
                                      .loaded = true,
                                      .length_ns = 12300000000,
                                      .complete = i != 3,
                                      .trouble = i == 4 ? "no colour and no depth" : NULL};
    snapshot.number = 7;
    snapshot.calibration.color = snapshot.calibration.depth = image.lens;
    snapshot.counters.frames_per_s = 29.6;
    snapshot.counters.mb_per_s = 12.4;
    snapshot.counters.minutes_left = 420;
    snapshot.distance_m = 2.7;
    snapshot.has_place = true;
    snapshot.share = 0.4;
    snprintf(snapshot.text, sizeof snapshot.text,
             "Your feet are not in the picture: go back half a metre, or tilt the sensor down");
    struct take_verdict *verdict = &snapshot.judgement.verdict;
    verdict->seen = true;
    for (int i = 0; i < VERDICT_LINES; i++)
        verdict_say(verdict, 1, "your back was never seen: turn all the way round, 45 %% of the body was seen so far");
    struct map_advice *advice = &snapshot.room.advice;
    snprintf(advice->summary, sizeof advice->summary,
             "tags fit to 0.21 pixels, depth to 6 mm; the worst tag is known to 4 mm");
    advice->count = MAP_ADVICE_LINES;
    for (int i = 0; i < MAP_ADVICE_LINES; i++)
        snprintf(advice->line[i], sizeof advice->line[i],
                 "tag 12 was seen from one side only: walk round it, from three sides at least, two metres away");
    for (int i = 0; i < 12; i++) {
        snprintf(devices[i].name, sizeof devices[i].name, "Depth camera number %d", i);
        snprintf(devices[i].uri, sizeof devices[i].uri, "openni:%d", i);
    }
}

// ---------------------------------------------------------------- drawing

static void begin(void)
{
    t.input.width_px = t.size.width;
    t.input.height_px = t.size.height;
    t.input.px_per_dp = t.px_per_dp;
    EXPECT_STATUS(ui_begin(t.ui, &t.input), OK);
}

static void draw_watch(const struct brush *b)
{
    const struct watch_page page = {"film.reenact", long_name, &image, &times, 16, &room_page};
    screen_watch(b, &t.screens, &t.state, &page, t.input.now_ns);
    screen_message(b, &t.state);
}

static void draw_takes(const struct brush *b)
{
    const struct takes_page page = {japanese, cards, 9};
    screen_takes(b, &t.screens, &t.state, &page, t.input.now_ns);
}

static void draw_live(const struct brush *b)
{
    screen_live(b, &t.screens, &t.state, &live_page, t.input.now_ns);
    screen_message(b, &t.state);
}

static void draw_summary(const struct brush *b)
{
    screen_summary(b, &t.screens, &t.state, &live_page, t.input.now_ns);
    screen_message(b, &t.state);
}

static void draw_trouble(const struct brush *b) { screen_trouble(b, &t.state, t.input.now_ns); }

static void draw_studio(const struct brush *b)
{
    const struct studio_view view = {japanese, devices, t.studio.sensor_count,  &snapshot, NULL,
                                     NULL,     NULL,    {0.25, 0.25, 0.5, 0.5}, &t.scroll};
    studio_screen_draw(b, &t.studio, &view, t.input.now_ns);
}

typedef void draw_fn(const struct brush *b);

static void draw(draw_fn *fn)
{
    const struct brush b = {t.ui, theme_of(true), NULL};
    for (int n = 0; n < 3; n++) { // letters beyond Latin come with the second, heights with the next
        t.input.now_ns += 16000000;
        begin();
        fn(&b);
        ui_end(t.ui);
    }
}

static void save(const char *name)
{
    char path[600];
    uint8_t *rgba;
    if (!t.folder)
        return;
    rgba = malloc(4 * (size_t)t.size.width * (size_t)t.size.height);
    EXPECT_STATUS(ui_draw(t.ui, t.target, 0), OK);
    EXPECT_STATUS(gpu_target_read(t.target, rgba), OK);
    snprintf(path, sizeof path, "%s/%s-%dx%d-%.0f.png", t.folder, name, t.size.width, t.size.height,
             100 * t.state.text_size);
    EXPECT_STATUS(png_write(path, PNG_RGBA8, rgba, t.size.width, t.size.height), OK);
    free(rgba);
}

static const struct ui_mark *find_mark(bool is_text, const char *beginning)
{
    int count = 0;
    const struct ui_mark *marks = ui_marks(t.ui, &count);
    for (int i = 0; i < count; i++)
        if (marks[i].is_text == is_text && !strncmp(marks[i].text, beginning, strlen(beginning)))
            return &marks[i];
    return NULL;
}

// ---------------------------------------------------------------- what must hold

static bool within(struct ui_box a, struct ui_box b, double slack)
{
    return a.x >= b.x - slack && a.y >= b.y - slack && a.x + a.w <= b.x + b.w + slack && a.y + a.h <= b.y + b.h + slack;
}

static bool overlap(struct ui_box a, struct ui_box b, double slack)
{
    return a.x + slack < b.x + b.w && b.x + slack < a.x + a.w && a.y + slack < b.y + b.h && b.y + slack < a.y + a.h;
}

static bool any_of(const char *name, const char *const *names)
{
    for (; *names; names++)
        if (!strcmp(name, *names))
            return true;
    return false;
}

// Areas that take touches behind the controls, or lie under all of a panel.
static bool is_ground(const struct ui_mark *m)
{
    static const char *const grounds[] = {"image", "map-image", "panel", "sheet", "live-panel", NULL};
    return !m->is_text && any_of(m->text, grounds);
}

// The user's own names may be shortened; nothing that the program says.
static bool is_own_name(const struct ui_mark *m)
{
    return !strncmp(m->text, long_name, 6) || !strncmp(m->text, japanese, 3) || !strncmp(m->text, "???", 3) ||
           !strncmp(m->text, "film", 4) || strstr(m->text, "a file of a long name");
}

static bool scrolls(const struct ui_mark *m, struct ui_box all) { return !within(all, m->clip, 1.5); }

static void print_mark(const char *screen, const char *what, const struct ui_mark *m)
{
    print_error("%s at %dx%d, %.0f dpi, text %.0f %%: '%s' %s: %.0f, %.0f, %.0f x %.0f\n", screen, t.size.width,
                t.size.height, t.size.dpi, 100 * t.state.text_size, m->text, what, m->box.x, m->box.y, m->box.w,
                m->box.h);
}

static int check_mark(const char *screen, const struct ui_mark *m, struct ui_box all)
{
    const double mm = t.px_per_dp / t.size.dpi * 25.4;
    int bad = 0;
    if (is_ground(m))
        return 0;
    if (m->is_text && m->shortened && !is_own_name(m)) {
        print_mark(screen, "is shortened", m);
        bad++;
    }
    // What scrolls is cut by its box above and below; never to the sides.
    const struct ui_box low_high = {m->clip.x, -1e6, m->clip.w, 2e6};
    if (!within(m->box, scrolls(m, all) ? low_high : all, 1.5)) {
        print_mark(screen, "is cut", m);
        bad++;
    }
    if (!m->is_text && fmin(m->box.w, m->box.h) * mm < finger_mm - 0.05) {
        print_mark(screen, "is too small for a finger", m);
        bad++;
    }
    return bad;
}

// A label inside of its own button is no overlap; one that crosses a button's edge is.
static bool collide(const struct ui_mark *a, const struct ui_mark *b, struct ui_box all)
{
    struct ui_box p = a->box, q = b->box;
    if (is_ground(a) || is_ground(b) || (a->layer != b->layer) || scrolls(a, all) != scrolls(b, all))
        return false;
    if (!overlap(p, q, 2.5))
        return false;
    if (a->is_text && b->is_text)
        return true;
    return a->is_text ? !within(p, q, 3) : b->is_text ? !within(q, p, 3) : true;
}

static void expect_fits(const char *screen, draw_fn *fn)
{
    draw(fn);
    int count = 0, bad = 0;
    const struct ui_box all = {0, 0, ui_width(t.ui), ui_height(t.ui)};
    const struct ui_mark *marks = ui_marks(t.ui, &count);
    save(screen);
    for (int i = 0; i < count; i++) {
        bad += check_mark(screen, &marks[i], all);
        for (int k = 0; k < i; k++)
            if (collide(&marks[i], &marks[k], all)) {
                print_mark(screen, "lies over another", &marks[i]);
                print_mark(screen, "which is this", &marks[k]);
                bad++;
            }
    }
    EXPECT_AT_LEAST(count, 2);
    t.bad += bad;
}

static void reset(void)
{
    const double text = t.state.text_size > 0 ? t.state.text_size : 1;
    t.screens = (struct screens){0};
    room_ui_start(&t.screens.room);
    t.state = view_state_start(3, true, 0);
    t.state.page = PAGE_WATCH;
    t.state.text_size = text;
    t.state.camera.requested = true;
    t.state.room.has_place = true;
    t.state.room.thing_count = 40;
    t.state.playback = playback_start(12000000000, 360);
    t.state.live = live_state_start(true);
    t.state.live.length_ns = t.state.live.marked_to_ns = 12000000000;
    t.studio = studio_start(true);
}

static void choose_glass(size_t size, double text_size)
{
    t.size = sizes[size];
    t.px_per_dp = viewer_px_per_dp_with_text(viewer_px_per_dp(t.size.dpi), text_size, t.size.width, t.size.height);
    t.state.text_size = text_size;
    gpu_target_close(&t.target);
    EXPECT_STATUS(gpu_target_open(&t.target, t.gpu, t.size.width, t.size.height), OK);
    reset();
}

// ---------------------------------------------------------------- tests

static void check_watching(void)
{
    static const struct {
        const char *name;
        enum view_sheet sheet;
        bool moving, trim, map;
    } shown[] = {{"watch", SHEET_NONE, false, false, false},   {"layers", SHEET_LAYERS, false, false, false},
                 {"speed", SHEET_SPEED, false, false, false},  {"things", SHEET_THINGS, false, false, false},
                 {"card", SHEET_CARD, false, false, false},    {"moving", SHEET_NONE, true, false, false},
                 {"trimming", SHEET_NONE, false, true, false}, {"map", SHEET_NONE, false, false, true}};
    for (size_t i = 0; i < COUNT_OF(shown); i++) {
        reset();
        t.state.sheet = shown[i].sheet;
        t.state.moving = shown[i].moving;
        t.state.trim = (struct view_trim){shown[i].trim, 1000000000, 9000000000, false};
        t.state.room.map = shown[i].map;
        t.state.room.card = 0;
        expect_fits(shown[i].name, draw_watch);
    }
}

static void check_takes(void)
{
    t.state.page = PAGE_TAKES;
    expect_fits("takes", draw_takes);
    t.state.compare.asked = CHOICE_REFERENCE;
    expect_fits("takes-reference", draw_takes);
    t.state.compare.asked = CHOICE_ATTEMPT;
    t.state.compare.reference = 2; // of a long name
    expect_fits("takes-attempt", draw_takes);
    t.state.compare.asked = CHOICE_NONE;
    t.state.page = PAGE_TROUBLE;
    t.state.trouble =
        "/home/someone/films/a file of a long name.reenact is damaged at its end: the power was cut while "
        "it was written. reenact-capture repair makes a copy of what can be read of it.";
    expect_fits("trouble", draw_trouble);
}

static void show_summary(int count)
{
    struct live_state *l = &t.state.live;
    t.state.page = PAGE_LIVE;
    l->phase = LIVE_SUMMARY;
    l->judged = l->finished = l->results_ever = l->result_count = 3;
    for (int i = 0; i < 3; i++)
        l->results[i] = (struct live_result){.score = 60.0 + 7 * i, .sigma = 14, .compared = true};
    l->review_length_ns = 8000000000;
    comparison.finding_count = count;
    live_page.comparison = &comparison;
    t.screens = (struct screens){.summary = 3};
}

// What is said for some seconds over a page, with the shape behind it, as screen_message draws it.
static struct ui_box notice_box(const struct ui_mark *text)
{
    static const double BEFORE = 58, BEHIND = 20, LEAST_H = 58, ABOVE = 14; // dp
    const double above = fmax(ABOVE, (LEAST_H - text->box.h) / 2);
    return (struct ui_box){text->box.x - BEFORE, text->box.y - above, text->box.w + BEFORE + BEHIND,
                           text->box.h + 2 * above};
}

// The strip over time, and where the screen has no other place the list, take fingers through it.
static bool may_be_covered(const struct ui_mark *m, struct ui_box all)
{
    const struct ui_mark *strip_mark = find_mark(false, "summary-strip");
    if (!strip_mark)
        return false;
    const struct ui_box row = {0, strip_mark->box.y - 2, ui_width(t.ui), strip_mark->box.h + 4};
    return m == strip_mark || within(m->box, row, 0) || scrolls(m, all) || !strncmp(m->text, "and ", 4);
}

// Lies on no control, and on no text.
static void expect_notice_beside(const char *screen, draw_fn *fn)
{
    draw(fn);
    save(screen);
    int count = 0;
    char beginning[24];
    snprintf(beginning, sizeof beginning, "%.20s", t.state.notice);
    const struct ui_box all = {0, 0, ui_width(t.ui), ui_height(t.ui)};
    const struct ui_mark *marks = ui_marks(t.ui, &count), *notice = find_mark(true, beginning);
    EXPECT_TRUE(notice != NULL);
    t.bad += check_mark(screen, notice, all);
    const struct ui_box box = notice_box(notice);
    for (int i = 0; i < count; i++)
        if (&marks[i] != notice && !is_ground(&marks[i]) && overlap(box, marks[i].box, 2.5) &&
            !may_be_covered(&marks[i], all)) {
            print_mark(screen, "lies over another", notice);
            print_mark(screen, "which is this", &marks[i]);
            t.bad++;
        }
}

static void check_notices(void)
{
    static const char *const notices[] = {
        "Saved reenact-2026-11-29-01.png",
        "The camera was unplugged: plug it in again, the take can be watched meanwhile; a camera that is "
        "seen and not opened may be in use by another"};
    for (size_t i = 0; i < COUNT_OF(notices); i++) {
        reset();
        view_state_warn(&t.state, notices[i], t.input.now_ns);
        expect_notice_beside("notice-watch", draw_watch);
        t.state.page = PAGE_LIVE;
        expect_notice_beside("notice-ready", draw_live);
        t.state.live.phase = LIVE_DOING;
        expect_notice_beside("notice-doing", draw_live);
        show_summary(10);
        expect_notice_beside("notice-summary", draw_summary);
    }
}

static void check_doing(void)
{
    static const char *const names[LIVE_SCREENS] = {"mirror", "beside", "room"};
    t.state.page = PAGE_LIVE;
    for (int screen = 0; screen < LIVE_SCREENS; screen++) {
        t.state.live.screen = (enum live_screen)screen;
        t.state.live.phase = LIVE_DOING;
        expect_fits(names[screen], draw_live);
    }
    const bool in_panel = find_mark(false, "live-mark-from") && find_mark(false, "live-mark-to");
    t.state.sheet = SHEET_LIVE;
    t.state.live.screen = LIVE_MIRROR;
    expect_fits("how", draw_live);
    // A part is marked by touch on every screen.
    const struct ui_mark *from = find_mark(false, "live-mark-from");
    if (!in_panel)
        EXPECT_TRUE(from && find_mark(false, "live-mark-to") && within(from->box, from->clip, 1.5));
    t.state.sheet = SHEET_NONE;
    t.state.live.phase = LIVE_COUNT_IN;
    live_page.verdicts = NULL;
    expect_fits("count-in", draw_live);
    live_page.verdicts = verdicts;
}

static void check_summary(void)
{
    static const int counts[] = {0, 1, 10, 30};
    for (size_t i = 0; i < COUNT_OF(counts); i++) {
        char name[32];
        snprintf(name, sizeof name, "summary-%d", counts[i]);
        show_summary(counts[i]);
        live_page.mirrored = i & 1;
        expect_fits(name, draw_summary);
    }
    // Of two takes, while they are compared and afterwards.
    t.state.live.of_takes = true;
    live_page.names[0] = long_name;
    live_page.names[1] = japanese;
    expect_fits("summary-takes", draw_summary);
    t.state.live.judged--;
    live_page.comparison = NULL;
    expect_fits("summary-comparing", draw_summary);
    t.state.live.of_takes = false;
    live_page.names[0] = live_page.names[1] = NULL;
}

static void tap(draw_fn *fn, double x, double y)
{
    t.input.pointer_x = x;
    t.input.pointer_y = y;
    t.input.pointer_there = true;
    draw(fn);
    t.input.pointer_down = true;
    draw(fn);
    t.input.pointer_down = false;
    draw(fn);
    t.input.pointer_there = false;
    draw(fn);
}

// Notes whether the finding's upper and lower ends are in sight; returns whether all of it is.
static bool note_ends(const struct ui_mark *m, bool seen[30][2])
{
    const double top = m->box.y, bottom = m->box.y + m->box.h, low = m->clip.y - 1.5,
                 high = m->clip.y + m->clip.h + 1.5;
    const int finding = atoi(m->text + 8);
    seen[finding][0] |= top >= low && top < high;
    seen[finding][1] |= bottom > low && bottom <= high;
    return within(m->box, m->clip, 1.5);
}

// Each of 30 is in sight at some time while the list is turned, and the list says how many are below.
static void check_list(void)
{
    bool seen[30][2] = {0};
    show_summary(30);
    t.screens.all_findings = true;
    draw(draw_summary);
    const struct ui_mark *more = find_mark(true, "and ");
    EXPECT_TRUE(more != NULL);
    int below = more ? atoi(more->text + 4) : 0, whole = 0;
    double before = -1;
    for (int turn = 0; turn < 1000 && t.screens.findings.at > before; turn++) {
        int count = 0;
        before = t.screens.findings.at;
        const struct ui_mark *marks = ui_marks(t.ui, &count);
        for (int i = 0; i < count; i++)
            if (!marks[i].is_text && !strncmp(marks[i].text, "finding-", 8))
                whole += note_ends(&marks[i], seen) && turn == 0;
        EXPECT_TRUE(screens_wheel(&t.screens, &t.state, middle(t.screens.findings.box), -0.5));
        draw(draw_summary);
    }
    EXPECT_INT(whole + below, 30);
    for (int i = 0; i < 30; i++) {
        if (!seen[i][0] || !seen[i][1])
            print_error("finding %d is never in sight at %dx%d, text %.0f %%: the list is %.0f dp high\n", i,
                        t.size.width, t.size.height, 100 * t.state.text_size, t.screens.findings.box.h);
        EXPECT_TRUE(seen[i][0] && seen[i][1]);
    }
}

static void check_touch(void)
{
    show_summary(30);
    t.state.live.review_at_ns = 0;
    draw(draw_summary);
    const struct ui_mark *first = find_mark(false, "finding-0");
    EXPECT_TRUE(first != NULL);
    const struct ui_point at = {first->box.x + 20, fmax(first->box.y, first->clip.y) + 10};
    tap(draw_summary, at.x, at.y);
    EXPECT_INT(t.screens.finding, 1);
    EXPECT_INT(t.state.live.review_from_ns, 200000000); // from 0.0 s to 0.4 s
    // A key chooses the next one; and brings it into sight.
    for (int n = 2; n <= 30; n++) {
        view_state_do(&t.state, DO_NEXT, 0);
        draw(draw_summary);
        EXPECT_INT(t.screens.finding, n);
        EXPECT_NEAR((double)t.state.live.review_from_ns, 2e8 * (n - 1) + 2e8, 1e3);
        char name[32];
        snprintf(name, sizeof name, "finding-%d", n - 1);
        const struct ui_mark *m = find_mark(false, name);
        EXPECT_TRUE(m && (within(m->box, m->clip, 1.5) || m->box.h > m->clip.h));
    }
    // Dragging scrolls, and is no tap.
    show_summary(30);
    t.screens.all_findings = true;
    draw(draw_summary);
    t.input.pointer_x = at.x;
    t.input.pointer_y = at.y;
    t.input.pointer_there = t.input.pointer_down = true;
    draw(draw_summary);
    t.input.pointer_y = at.y - 50;
    draw(draw_summary);
    t.input.pointer_down = false;
    draw(draw_summary);
    t.input.pointer_there = false;
    draw(draw_summary);
    EXPECT_NEAR(t.screens.findings.at, 50, 1);
    EXPECT_INT(t.screens.finding, 0);
}

// The three worst are listed, and the others by a touch; and what is good, unless there is no room for it.
static void check_worst(void)
{
    show_summary(10);
    for (int p = 0; p < PART_COUNT; p++)
        comparison.terms.part[p] = (struct part_deviation){.weight = 1};
    draw(draw_summary);
    save("summary-worst");
    if (t.size.width >= 1280 && t.state.text_size <= 1)
        EXPECT_TRUE(find_mark(true, "Good: the head, the trunk, the left arm") != NULL);
    EXPECT_TRUE(find_mark(false, "finding-0") && !find_mark(false, "finding-3"));
    EXPECT_TRUE(screens_wheel(&t.screens, &t.state, middle(t.screens.findings.box), -20));
    draw(draw_summary);
    const struct ui_mark *more = find_mark(false, "findings-more");
    EXPECT_TRUE(more && find_mark(true, "7 more"));
    const struct ui_point at = {more->box.x + 20, fmax(more->box.y, more->clip.y) + 20};
    tap(draw_summary, at.x, at.y);
    EXPECT_TRUE(t.screens.all_findings && !find_mark(false, "findings-more"));
    EXPECT_TRUE(screens_wheel(&t.screens, &t.state, middle(t.screens.findings.box), -40));
    draw(draw_summary);
    EXPECT_TRUE(find_mark(false, "finding-9") != NULL);
    memset(&comparison.terms, 0, sizeof comparison.terms);
}

// How many pixels of the box have the accent colour, or nearly.
static int count_accent(struct ui_box box)
{
    const uint32_t color = theme_of(true)->accent;
    const int width = t.size.width;
    uint8_t *rgba = malloc(4 * (size_t)width * (size_t)t.size.height);
    int count = 0;
    EXPECT_STATUS(ui_draw(t.ui, t.target, 0), OK);
    EXPECT_STATUS(gpu_target_read(t.target, rgba), OK);
    for (int y = (int)(box.y * t.px_per_dp); y < (int)((box.y + box.h) * t.px_per_dp) && y < t.size.height; y++)
        for (int x = (int)(box.x * t.px_per_dp); x < (int)((box.x + box.w) * t.px_per_dp) && x < width; x++) {
            const uint8_t *p = rgba + 4 * (y * width + x);
            count += abs(p[0] - (int)(color >> 24)) + abs(p[1] - (int)(color >> 16 & 255)) +
                         abs(p[2] - (int)(color >> 8 & 255)) <
                     40;
        }
    free(rgba);
    return count;
}

// A forearm alone, 3 m before the camera of `image`, in the middle of that box.
static struct skeleton forearm(struct ui_box box)
{
    struct skeleton s = {0};
    const struct part_ends ends = part_ends[PART_RIGHT_FOREARM];
    const struct cover cover = cover_of(&image.lens, (struct ui_box){0, 0, ui_width(t.ui), ui_height(t.ui)});
    const double m_per_dp = 3 / image.lens.fx / cover.scale, x = m_per_dp * (middle(box).x - ui_width(t.ui) / 2),
                 y = m_per_dp * (middle(box).y - ui_height(t.ui) / 2);
    s.joint[ends.from] = v3(x - 0.05, y, 3);
    s.joint[ends.to] = v3(x + 0.05, y, 3);
    s.confidence[ends.from] = s.confidence[ends.to] = 1;
    return s;
}

// The summary opens at the worst finding; the part of the one that is chosen stands out in the strip, where there is a
// row for each part or one for all, and in the figure.
static void test_part_of_the_chosen_finding_stands_out(void **state)
{
    (void)state;
    static const char *const part = "right forearm";
    for (int low = 0; low < 2; low++) {
        choose_glass(low ? 1 : 3, 1);
        show_summary(10);
        draw(draw_summary);
        const struct ui_box strip_box = find_mark(false, "summary-strip")->box,
                            figures = screen_summary_figures(ui_width(t.ui), ui_height(t.ui));
        const struct skeleton person = forearm(figures);
        live_page.attempt = &person;
        t.screens.summary = 0; // of another attempt
        draw(draw_summary);
        save("summary-chosen");
        EXPECT_INT(t.screens.finding, 1);
        EXPECT_TRUE(find_mark(true, part) != NULL);
        const int in_row = count_accent(strip_box), in_figure = count_accent(figures);
        t.screens.finding = 0;
        draw(draw_summary);
        EXPECT_INT(find_mark(true, part) != NULL, !low);
        const int plain_row = count_accent(strip_box), plain_figure = count_accent(figures);
        print_message("%s: of the accent's colour %d pixels in the strip, without a finding %d; in the figure %d and "
                      "%d\n",
                      low ? "one row" : "rows", in_row, plain_row, in_figure, plain_figure);
        EXPECT_AT_LEAST(in_row, plain_row + 20);
        EXPECT_AT_LEAST(in_figure, plain_figure + 200);
        // Another moment of the attempt is no longer the finding's.
        t.screens.finding = 1;
        draw(draw_summary);
        const struct ui_point at = middle(strip_box);
        tap(draw_summary, at.x, at.y);
        EXPECT_INT(t.screens.finding, 0);
        live_page.attempt = NULL;
    }
}

static void check_studio(void)
{
    static const struct {
        const char *name;
        enum studio_page page;
        int sensors;
        bool color;
        enum studio_erasure_kind waits; // and can be taken back
    } shown[] = {{"studio-sensors", STUDIO_SENSORS, 12, true, ERASES_NOTHING},
                 {"studio-no-sensor", STUDIO_SENSORS, 0, true, ERASES_NOTHING},
                 {"studio-live", STUDIO_LIVE, 1, true, ERASES_NOTHING},
                 {"studio-depth", STUDIO_LIVE, 1, false, ERASES_NOTHING},
                 {"studio-discarded", STUDIO_LIVE, 1, true, ERASES_TAKE},
                 {"studio-countdown", STUDIO_COUNTDOWN, 1, true, ERASES_NOTHING},
                 {"studio-recording", STUDIO_RECORDING, 1, true, ERASES_NOTHING},
                 {"studio-finishing", STUDIO_FINISHING, 1, true, ERASES_NOTHING},
                 {"studio-review", STUDIO_REVIEW, 1, true, ERASES_NOTHING},
                 {"studio-trimmed", STUDIO_REVIEW, 1, true, ERASES_ENDS},
                 {"studio-leaving", STUDIO_LEAVING, 1, true, ERASES_NOTHING},
                 {"studio-rename", STUDIO_RENAME, 1, true, ERASES_NOTHING},
                 {"studio-trouble", STUDIO_TROUBLE, 1, true, ERASES_NOTHING},
                 {"studio-room", STUDIO_ROOM, 1, true, ERASES_NOTHING},
                 {"studio-map", STUDIO_ROOM_FINISHING, 1, true, ERASES_NOTHING},
                 {"studio-room-review", STUDIO_ROOM_REVIEW, 1, true, ERASES_NOTHING}};
    for (size_t i = 0; i < COUNT_OF(shown); i++) {
        t.studio = studio_start(true);
        t.studio.page = shown[i].page;
        t.studio.sensor_count = shown[i].sensors;
        t.studio.left_s = 3;
        t.studio.text_size = t.state.text_size;
        t.studio.waiting = (struct studio_erasure){shown[i].waits, "take-12", 1000000000, 9400000000, t.input.now_ns};
        snprintf(t.studio.take, sizeof t.studio.take, "%s", "exercise");
        snprintf(t.studio.name, sizeof t.studio.name, "%s", "exercise");
        snprintf(t.studio.trouble, sizeof t.studio.trouble,
                 "The sensor sends no more pictures: its cable was pulled out, or it has no power. Plug it in again; "
                 "a Kinect also needs its own power supply.");
        t.scroll = (struct scroll){0};
        snapshot.without_color = shown[i].color ? 0 : 1000;
        expect_fits(shown[i].name, draw_studio);
    }
}

// At three metres a capital letter is 10 minutes of arc high, on tablets of 7 inches and more.
static void test_cues_are_read_from_three_metres(void **state)
{
    (void)state;
    static const double capital = 0.6; // of a line: Inter's capitals are 0.727 em, and an em is 0.83 of a line
    for (size_t i = 0; i < 5; i++) {
        choose_glass(i, 1);
        t.state.page = PAGE_LIVE;
        t.state.live.phase = LIVE_DOING;
        draw(draw_live);
        const struct ui_mark *cue = find_mark(true, "Left upper arm");
        EXPECT_TRUE(cue != NULL);
        const double lines = cue ? round(cue->box.h / cue->box.w < 0.3 ? 1 : 2) : 1;
        const double mm = cue ? cue->box.h / lines * capital * t.px_per_dp / t.size.dpi * 25.4 : 0;
        print_message("%dx%d: capitals of %.1f mm, %.1f minutes of arc at 3 m\n", t.size.width, t.size.height, mm,
                      atan(mm / 3000) * 60 * 180 / 3.14159265358979);
        EXPECT_AT_LEAST(mm, t.size.width > t.size.height ? 8.6 : 7);
    }
}

// What a developer wants to know is on no screen, unless asked for.
static void test_no_words_of_developers(void **state)
{
    (void)state;
    choose_glass(3, 1);
    for (int developer = 0; developer < 2; developer++) {
        reset();
        t.state.sheet = SHEET_LAYERS;
        t.state.developer = developer;
        draw(draw_watch);
        EXPECT_TRUE(!find_mark(true, "Error") == !developer);
        EXPECT_TRUE(!find_mark(true, "Where pixels") == !developer);
        EXPECT_TRUE(!find_mark(true, "Frame times") == !developer);
        EXPECT_TRUE(!find_mark(true, "Mirrored"));           // once, under the timeline
        EXPECT_TRUE(developer || find_mark(true, "Mirror")); // a longer sheet covers it
    }
}

// Where there is no room for words under an icon, they come when the pointer rests on it; a long touch does nothing
// else.
static void test_icons_have_words(void **state)
{
    (void)state;
    choose_glass(3, 1);
    draw(draw_watch);
    static const char *const words[] = {"Repeat", "Mirror", "Show", "Move", "Map", "Find", "Takes", "Around"};
    t.state.orbiting = false;
    draw(draw_watch);
    for (size_t i = 0; i < COUNT_OF(words); i++) {
        if (!find_mark(true, words[i]))
            print_error("no word '%s'\n", words[i]);
        EXPECT_TRUE(find_mark(true, words[i]) != NULL);
    }
    EXPECT_TRUE(!find_mark(true, "Photograph"));
    const struct ui_point at = middle(find_mark(false, "screenshot")->box);
    t.input.pointer_x = at.x;
    t.input.pointer_y = at.y;
    t.input.pointer_there = t.input.pointer_down = true;
    draw(draw_watch);
    t.input.now_ns += 600000000;
    draw(draw_watch);
    EXPECT_TRUE(find_mark(true, "Photograph") != NULL);
    t.input.pointer_down = false;
    draw(draw_watch);
    EXPECT_TRUE(!t.state.screenshot_wanted);
    tap(draw_watch, at.x, at.y);
    EXPECT_TRUE(t.state.screenshot_wanted);
}

// Letters take most of the time, so all checks share those of a size. Where a small screen takes no larger text the
// layout is the same as before.
static void test_every_screen_of_every_size(void **state)
{
    (void)state;
    static void (*const checks[])(void) = {check_watching, check_takes, check_notices, check_doing, check_summary,
                                           check_list,     check_touch, check_worst,   check_studio};
    t.bad = 0;
    for (size_t i = 0; i < COUNT_OF(sizes); i++)
        for (int text = 0; text < VIEW_TEXT_SIZES; text += SANITIZED ? VIEW_TEXT_SIZES - 1 : 1) {
            const double before = t.px_per_dp;
            choose_glass(i, view_text_sizes[text]);
            for (size_t k = 0; k < COUNT_OF(checks) && (!text || fabs(t.px_per_dp / before - 1) > 0.01); k++) {
                reset();
                checks[k]();
            }
        }
    EXPECT_INT(t.bad, 0);
}

static int set_up(void **state)
{
    (void)state;
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    EXPECT_STATUS(gpu_open(&t.gpu), OK);
    EXPECT_STATUS(ui_open(&t.ui, t.gpu, &shaders, theme_faces(), FACE_COUNT), OK);
    make_content();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    ui_close(&t.ui);
    gpu_target_close(&t.target);
    gpu_close(&t.gpu);
    return 0;
}

int main(int argc, char **argv)
{
    t.folder = argc > 1 ? argv[1] : NULL;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_screen_of_every_size),
        cmocka_unit_test(test_part_of_the_chosen_finding_stands_out),
        cmocka_unit_test(test_cues_are_read_from_three_metres),
        cmocka_unit_test(test_no_words_of_developers),
        cmocka_unit_test(test_icons_have_words),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
