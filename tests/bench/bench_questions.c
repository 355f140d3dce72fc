// Sections of the page: the study's questions, the budget of one displayed frame, levels of detail by distance.
#include "reenact/render/actor_renderer.h"
#include "reenact/skeleton/body_cylinders.h"
#include "tests/bench/bench_page.h"
#include "tests/bench/bench_study.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// ------------------------------------------------------------- questions

static const struct bench_row *row_named(const struct bench_result *r, const char *name)
{
    for (size_t i = 0; r && i < r->count; i++)
        if (!strcmp(r->rows[i].name, name) && !r->rows[i].group)
            return &r->rows[i];
    return NULL;
}

struct answered {
    const char *question, *figure;
    double ours, paper, video; // NaN: does not apply
    const char *unit, *why;
};

static void put_answers(const struct bench_page *page, const struct answered *a, size_t count)
{
    struct json *o = page->stages ? json_add_object(page->stages, NULL) : NULL;
    struct json *list = NULL;
    if (o) {
        json_add_string(o, "name", "questions");
        list = json_add_array(o, "answers");
    }
    if (page->html)
        fputs("<div class=\"scroll\"><table><tr><th>question</th><th>measured</th><th>ours</th><th>paper</th><th>plain "
              "video</th><th></th></tr>\n",
              page->html);
    for (size_t i = 0; i < count; i++) {
        const double values[3] = {a[i].ours, a[i].paper, a[i].video};
        if (page->html) {
            fprintf(page->html, "<tr><td>%s</td><td>%s</td>", a[i].question, a[i].figure);
            for (int k = 0; k < 3; k++)
                if (isnan(values[k]))
                    fputs("<td>–</td>", page->html);
                else if (isinf(values[k]))
                    fputs("<td>∞</td>", page->html);
                else
                    fprintf(page->html, "<td>%.3g %s</td>", values[k], a[i].unit);
            fprintf(page->html, "<td class=\"why\">%s</td></tr>\n", a[i].why);
        }
        struct json *q = list ? json_add_object(list, NULL) : NULL;
        if (q) {
            json_add_string(q, "question", a[i].question);
            json_add_string(q, "figure", a[i].figure);
            json_add_string(q, "unit", a[i].unit);
            json_add_number(q, "ours", a[i].ours);
            json_add_number(q, "paper", a[i].paper);
            json_add_number(q, "video", a[i].video);
        }
    }
    if (page->html)
        fputs("</table></div>\n", page->html);
}

enum status bench_put_questions(const struct bench_page *page, const struct bench_whole *w)
{
    const struct bench_study *s = &bench_study;
    const struct bench_result *views = bench_find_result(w, "views");
    const struct bench_row *full = row_named(views, "full"), *paper = row_named(views, "paper");
    if (!s->known || !full || !paper)
        return OK;
    if (page->html)
        fputs("<p>Dayrit et al. (2014) asked people whether they grasp where the actor is (Q1, Q2), whether moving the "
              "viewpoint helps (Q3, Q4), whether the picture satisfies (Q5), and whether a live person can be compared "
              "(Q6, Q7). What stands behind each answer, measured: the small world's dancer against its truth. Both "
              "levels of detail draw the same joints, so that Q1 to Q4 and Q6 are equal for them.</p>\n",
              page->html);
    const struct answered answers[] = {
        {"Q1 where is the actor in the room?", "error of a joint, median", s->room_mm, s->room_mm, NAN, "mm",
         "a video is not in the room"},
        {"", "95 %", s->room_p95_mm, s->room_p95_mm, NAN, "mm", ""},
        {"Q2 and in the picture?", "error of a joint, median", s->tablet_px, s->tablet_px, NAN, "px", ""},
        {"", "95 %", s->tablet_p95_px, s->tablet_p95_px, NAN, "px", ""},
        {"Q3 does the viewpoint help?", "depth of a joint, one side", s->one_side_mm, s->one_side_mm, s->one_side_mm,
         "mm", "from one side depth is not seen: the joints' spread"},
        {"Q4 and several?", "two sides", s->two_sides_mm, s->two_sides_mm, s->one_side_mm, "mm",
         "an eye that places a joint within 3 px; a video has one side"},
        {"", "eight sides", s->many_sides_mm, s->many_sides_mm, s->one_side_mm, "mm", ""},
        {"Q5 does the picture satisfy?", "wrong outline, median", full->error, paper->error, NAN, "%", ""},
        {"", "PSNR within the silhouette", full->extra[1], paper->extra[1], NAN, "dB", ""},
        {"", "PSNR", full->extra[0], paper->extra[0], NAN, "dB", ""},
        {"Q6 can movements be compared?", "direction of a part, median", s->angle_deg, s->angle_deg, NAN, "°",
         "a difference of 15° is noticed, 5° is not"},
        {"", "95 %", s->angle_p95_deg, s->angle_p95_deg, NAN, "°", ""},
        {"Q7 does the same movement count as the same?", "score of it, tracked", s->score, NAN, NAN, "of 100",
         "the paper has no score"},
    };
    put_answers(page, answers, COUNT_OF(answers));
    return OK;
}

// ------------------------------------------------------------- budget

enum status bench_put_budget(const struct bench_page *page, const struct bench_whole *w)
{
    static const char *const stages[][2] = {
        {"place", "find the tablet"}, {"search", "choose the frame"}, {"draw", "draw actor, shadow, image"}};
    double ms[COUNT_OF(stages)], sum = 0;
    for (size_t i = 0; i < COUNT_OF(stages); i++) {
        const struct bench_row *row = bench_find_usual(bench_find_result(w, stages[i][0]));
        ms[i] = row ? row->time_ms : 0;
        sum += ms[i];
    }
    struct json *o = page->stages ? json_add_object(page->stages, NULL) : NULL;
    if (o) {
        json_add_string(o, "name", "budget");
        for (size_t i = 0; i < COUNT_OF(stages); i++)
            json_add_number(o, stages[i][0], ms[i]);
        json_add_number(o, "sum_ms", sum);
    }
    if (!page->html || !(sum > 0))
        return OK;
    fprintf(page->html,
            "<p>Camera image in, picture out: %.1f ms of one core, one after the other; the app overlaps finding with "
            "drawing. Tracking an image, retrieval among 10 000 frames, drawing at 1280 × 800 with another frame's "
            "colours each time; medians of the stages above. The display's own wait is not in it.</p>\n<div "
            "class=\"bar\" role=\"img\">",
            sum);
    for (size_t i = 0; i < COUNT_OF(stages); i++)
        fprintf(page->html, "<span class=\"c%zu\" style=\"width:%.2f%%\" title=\"%s\">%.1f ms</span>", i,
                100 * ms[i] / sum, stages[i][1], ms[i]);
    fputs("</div><p>", page->html);
    for (size_t i = 0; i < COUNT_OF(stages); i++)
        fprintf(page->html, "<span class=\"key c%zu\"></span>%s %.2f ms (%.0f %%) ", i, stages[i][1], ms[i],
                100 * ms[i] / sum);
    fputs("</p>\n", page->html);
    return OK;
}

// ------------------------------------------------------------- levels of detail

// What is kept of the model at a distance, and why: errors predicted before drawing (actor_renderer.h).
static void put_kept(FILE *f)
{
    static const double distances[] = {0.7, 1, 1.5, 2, 3, 4, 6, 8, 12, 20, 40};
    const double f_px = 1000, texel_m = 0.004, limb_m = 0.06, radius_m = 0.08;
    fputs("<p>Only what the scene needs: <code>auto</code> draws the body cylinders where their predicted error would "
          "be below a pixel (here a lens of f = 1000 px), else the avatar. The avatar keeps its 2500 triangles and 4 "
          "mm texels at every "
          "distance: it is three draw calls.</p><div class=\"scroll\"><table><tr><th>distance</th><th>px/m</th>"
          "<th>cylinders' error</th><th>avatar's error</th><th>auto takes</th><th>triangles</th><th>sides of a limb"
          "</th><th>a texel</th><th>frames' colours</th></tr>\n",
          f);
    for (size_t i = 0; i < COUNT_OF(distances); i++) {
        const double scale = f_px / distances[i], paper = lod_outline_error_m(DETAIL_PARTS, radius_m, 0) * scale,
                     full = lod_outline_error_m(DETAIL_FULL, radius_m, 0) * scale;
        const bool cylinders = paper <= 1;
        const int sides = cylinder_sides(limb_m * scale, 1);
        fprintf(f,
                "<tr><td>%g m</td><td>%.0f</td><td>%.2f px</td><td>%.2f px</td><td>%s</td><td>%d</td><td>%d</td>"
                "<td>%.2f px</td><td>%s</td></tr>\n",
                distances[i], scale, paper, full, cylinders ? "cylinders" : "avatar", cylinders ? 11 * 2 * sides : 2500,
                sides, texel_m * scale, cylinders ? "one frame's" : "one frame's, and all in the atlas");
    }
    fputs("</table></div>\n", f);
}

static double value_of(const struct bench_plain *p, size_t row, const char *column)
{
    for (size_t k = 0; k < p->columns; k++)
        if (!strcmp(p->column[k], column))
            return p->rows[row].value[k];
    return NAN;
}

enum status bench_put_levels(const struct bench_page *page, const struct bench_whole *w)
{
    static struct bench_curve curve[BENCH_CURVES];
    struct bench_curves curves = {"measured", "distance, m", "error of the silhouette, px", curve, 0};
    const struct bench_plain *p = bench_find_plain(w, "levels");
    memset(curve, 0, sizeof curve);
    for (size_t i = 0; p && i < p->count; i++) {
        const char *name = strstr(p->rows[i].name, ", ");
        int k = 0;
        while (name && k < curves.count && strcmp(curve[k].name, name + 2))
            k++;
        if (!name || k == BENCH_CURVES)
            continue;
        if (k == curves.count)
            curve[curves.count++] = (struct bench_curve){.name = name + 2, .exponent = NAN};
        if (curve[k].count < BENCH_SIZES) {
            curve[k].size[curve[k].count] = strtod(p->rows[i].name, NULL);
            curve[k].value[curve[k].count++] = value_of(p, i, "error_px");
        }
    }
    if (page->stages && p)
        bench_add_plain_json(page->stages, p);
    if (!page->html)
        return OK;
    put_kept(page->html);
    if (!p)
        return OK;
    fputs("<p>Measured in the small world, next to the prediction:</p>\n", page->html);
    bench_put_curves(page->html, &curves);
    bench_put_plain_table(page->html, p);
    return OK;
}
