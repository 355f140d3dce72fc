// Stage "skeleton" on random films: how often the tracked skeleton is wrong, and how sure it is then, over all films
// and by cause.
#include "tests/bench/bench_dice.h"

#include "tests/bench/bench_skeleton_trials.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { POSTURE_MOTIONS = 240, WORST = 10, FACINGS = 8, DISTANCES = 7 };

static const char *const columns[] = {
    "films",     "frames",    "lost_%",    "ghosts_%",  "other_%",   "mean_mm",  "geo_mm",    "less_mm",
    "angle_deg", "in10_%",    "in10hid_%", "in10all_%", "arms_%",    "legs_%",   "body_%",    "swapped_%",
    "seen15_%",  "infer15_%", "seen_%",    "infer_%",   "unknown_%", "seen95_%", "infer95_%",
};

struct dice_trial {
    struct bench *b;
    const struct bench_dice *dice;
    const char *motions_folder;
    struct dice_motions motions;
    struct dice_film *films;
    int count;
    struct dice_rig rig[DICE_MODES];
};

// ---------------------------------------------------------------- causes

static bool has_figure(const struct dice_film *film, const struct dice_frame *frame, int value)
{
    (void)frame;
    const char *names = world_figure_names();
    for (; value > 0; value--)
        names = strchr(names, ' ') + 1;
    const size_t length = strcspn(names, " ");
    return strlen(film->plan.actor.figure) == length && !strncmp(film->plan.actor.figure, names, length);
}

static bool has_facing(const struct dice_film *film, const struct dice_frame *frame, int value)
{
    (void)film;
    return (int)floor((frame->facing_degrees + 360 + 22.5) / 45) % FACINGS == value;
}

static const double distance_edges[DISTANCES - 1] = {1.5, 2, 2.5, 3, 3.5, 4};

static bool has_distance(const struct dice_film *film, const struct dice_frame *frame, int value)
{
    (void)film;
    return (value == 0 || frame->distance_m >= distance_edges[value - 1]) &&
           (value == DISTANCES - 1 || frame->distance_m < distance_edges[value]);
}

static bool has_situation(const struct dice_film *film, const struct dice_frame *frame, int value)
{
    (void)frame;
    return (int)film->plan.situation == value;
}

static bool is_later(const struct dice_film *film, const struct dice_frame *frame, int value)
{
    return (frame - film->frame >= DICE_HZ) == value;
}

static bool has_size(const struct dice_film *film, const struct dice_frame *frame, int value)
{
    (void)frame;
    return (film->plan.scale > 0.75) == value;
}

static bool is_swept(const struct dice_film *film, const struct dice_frame *frame, int value)
{
    (void)frame;
    return film->plan.swept == value;
}

// ---------------------------------------------------------------- the table

static enum status add_row(struct dice_trial *t, const char *name, enum dice_mode mode, struct dice_group group)
{
    const struct dice_measure m = dice_measure_of(t->films, t->count, mode, &t->rig[mode], group);
    if (!m.films)
        return OK;
    char label[64];
    static const char *const suffix[DICE_MODES] = {", online", "", ", one image", ", c. online", ", colour"};
    snprintf(label, sizeof label, "%.28s%s", name, suffix[mode]);
    const double value[COUNT_OF(columns)] = {
        m.films,
        m.frames,
        m.lost,
        m.ghosts,
        m.followed_other,
        m.mean_mm,
        m.geometric_mm,
        m.less_mm,
        m.angle_degrees,
        m.within_seen,
        m.within_hidden,
        m.within_all,
        m.swapped[DICE_SWAP_ARMS],
        m.swapped[DICE_SWAP_LEGS],
        m.swapped[DICE_SWAP_BODY],
        m.swapped_any,
        m.sure_wrong,
        m.guessed_wrong,
        m.sure,
        m.guessed,
        m.unknown,
        m.sure_inside,
        m.guessed_inside,
    };
    return bench_add_row(t->b, label, value);
}

static enum status add_rows(struct dice_trial *t, const char *name, struct dice_group group)
{
    enum status status = OK;
    for (int mode = 0; mode < t->films[0].modes && status == OK; mode++)
        status = add_row(t, name, (enum dice_mode)mode, group);
    return status;
}

static const char *last_part(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

// A posture of another seed ("push-up:7") is the same motion.
static bool is_same_motion(const char *a, const char *b)
{
    const size_t length = strcspn(a, ":");
    return length == strcspn(b, ":") && !strncmp(a, b, length);
}

static bool is_repeated(const struct dice_motions *motions, int index)
{
    for (int i = 0; i < index; i++)
        if (is_same_motion(motions->name[i], motions->name[index]))
            return true;
    return false;
}

static enum status add_motions(struct dice_trial *t)
{
    enum status status = OK;
    for (int i = 0; i < t->motions.count && status == OK; i++) {
        struct dice_trial of = *t;
        char name[64];
        if (is_repeated(&t->motions, i))
            continue;
        of.count = 0;
        of.films = calloc((size_t)t->count, sizeof *of.films);
        if (!of.films)
            return fail(ERR_MEMORY, "no memory for the bench");
        for (int k = 0; k < t->count; k++)
            if (is_same_motion(t->films[k].plan.actor.motion, t->motions.name[i]))
                of.films[of.count++] = t->films[k]; // borrowed
        const char *part = last_part(t->motions.name[i]);
        snprintf(name, sizeof name, "%.*s", (int)strcspn(part, ":"), part);
        status = add_rows(&of, name, (struct dice_group){0});
        free(of.films);
    }
    return status;
}

static enum status add_figures(struct dice_trial *t)
{
    char names[256], *rest = names, *name;
    enum status status = OK;
    snprintf(names, sizeof names, "%s", world_figure_names());
    for (int i = 0; status == OK && (name = strsep(&rest, " ")); i++)
        status = add_rows(t, name, (struct dice_group){has_figure, i});
    return status;
}

static enum status add_causes(struct dice_trial *t)
{
    static const char *const facings[FACINGS] = {"front", "left front", "left side",  "left back",
                                                 "back",  "right back", "right side", "right front"};
    char name[64];
    enum status status = add_figures(t);
    for (int i = 0; i < FACINGS && status == OK; i++) {
        snprintf(name, sizeof name, "from %s", facings[i]);
        status = add_rows(t, name, (struct dice_group){has_facing, i});
    }
    for (int i = 0; i < DISTANCES && status == OK; i++) {
        if (i < DISTANCES - 1)
            snprintf(name, sizeof name, "below %.1f m", distance_edges[i]);
        else
            snprintf(name, sizeof name, "%.1f m and more", distance_edges[i - 1]);
        status = add_rows(t, name, (struct dice_group){has_distance, i});
    }
    for (int i = 0; i < DICE_SITUATIONS && status == OK; i++)
        status = add_rows(t, dice_situation_name((enum dice_situation)i), (struct dice_group){has_situation, i});
    for (int i = 0; i < 2 && status == OK; i++)
        status = add_rows(t, i ? "later" : "first second", (struct dice_group){is_later, i});
    for (int i = 0; i < 2 && status == OK; i++)
        status = add_rows(t, i ? "640x480" : "320x240", (struct dice_group){has_size, i});
    for (int i = 0; i < 2 && status == OK; i++)
        status = add_rows(t, i ? "swept" : "unswept", (struct dice_group){is_swept, i});
    return status == OK ? add_motions(t) : status;
}

// ---------------------------------------------------------------- film by film

static struct dice_measure of_film(const struct dice_trial *t, int i, enum dice_mode mode)
{
    return dice_measure_of(&t->films[i], 1, mode, &t->rig[mode], (struct dice_group){0});
}

static void print_command(const struct dice_trial *t, int i)
{
    printf("reenact-bench skeleton --dice 1 --seed %llu --only %d", (unsigned long long)t->dice->seed,
           t->films[i].plan.index);
    if (t->dice->seconds < 5 || t->dice->seconds > 5)
        printf(" --seconds %g", t->dice->seconds);
    if (t->motions_folder)
        printf(" --motions %s", t->motions_folder);
    if (t->dice->postures)
        printf(" --postures");
    if (t->dice->color)
        printf(" --color");
    printf("\n");
}

static void print_film(const struct dice_trial *t, int i)
{
    const struct dice_film *f = &t->films[i];
    const struct dice_plan *p = &f->plan;
    const struct dice_frame *middle = &f->frame[p->frames / 2];
    const struct dice_measure online = of_film(t, i, DICE_ONLINE), smoothed = of_film(t, i, DICE_SMOOTHED);
    char color[128] = "";
    if (f->modes > DICE_COLOR_SMOOTHED) {
        const struct dice_measure o = of_film(t, i, DICE_COLOR_ONLINE), m = of_film(t, i, DICE_COLOR_SMOOTHED);
        snprintf(color, sizeof color, "  colour online %4.0f mm %3.0f%%  smoothed %4.0f mm %3.0f%%", o.mean_mm,
                 o.within_seen, m.mean_mm, m.within_seen);
    }
    printf("  %5d %-6s %-14.14s %5.2f s  %-9s %-7s %s %5.2f m %5.0f deg  %3d frames  online %4.0f mm %3.0f%%  smoothed "
           "%4.0f mm %3.0f%%%s  %4.1f + %4.1f s\n",
           p->index, p->actor.figure, last_part(p->actor.motion), p->actor.start_s, dice_situation_name(p->situation),
           p->swept ? "swept" : "unswept", p->scale > 0.75 ? "640" : "320", middle->distance_m, middle->facing_degrees,
           smoothed.frames, online.mean_mm, online.within_seen, smoothed.mean_mm, smoothed.within_seen, color,
           f->filmed_s, f->tracked_s);
}

struct ranked {
    int film;
    double error_mm; // smoothed
};

static int worse_first(const void *a, const void *b)
{
    const struct ranked *x = a, *y = b;
    return x->error_mm < y->error_mm ? 1 : x->error_mm > y->error_mm ? -1 : (x->film > y->film) - (x->film < y->film);
}

static enum status show_worst(const struct dice_trial *t)
{
    struct ranked *rank = calloc((size_t)t->count, sizeof *rank);
    if (!rank)
        return fail(ERR_MEMORY, "no memory for the bench");
    for (int i = 0; i < t->count; i++) {
        const struct dice_measure m = of_film(t, i, DICE_SMOOTHED);
        rank[i] = (struct ranked){i, !m.frames ? 0 : isnan(m.mean_mm) ? 1e6 : m.mean_mm}; // NaN: lost throughout
    }
    qsort(rank, (size_t)t->count, sizeof *rank, worse_first);
    enum status status = OK;
    for (int i = 0; i < t->count && i < WORST && status == OK; i++) {
        if (!bench_inputs(t->b)->json) {
            print_film(t, rank[i].film);
            printf("        ");
            print_command(t, rank[i].film);
        }
        if (t->dice->strip)
            status = dice_strip_write(&t->films[rank[i].film], t->dice->strip);
    }
    free(rank);
    return status;
}

static enum status show(struct dice_trial *t)
{
    const bool json = bench_inputs(t->b)->json;
    if (!json)
        printf("Films: index, figure, motion and where it begins, situation, room, image width, distance and facing "
               "(0: the sensor, +: own left is nearer) in the middle; frames in which the person shows; mean error and "
               "joints within 10 cm of those that can be seen at all; processor time of filming and tracking.\n");
    for (int i = 0; i < t->count && !json; i++)
        print_film(t, i);
    if (!json)
        printf("\nThe worst:\n");
    enum status status = show_worst(t);
    if (!json)
        printf("\n");
    return status;
}

enum status trial_dice(struct bench *b, const struct bench_dice *dice, const char *motions)
{
    struct dice_trial t = {.b = b, .dice = dice, .motions_folder = motions};
    t.count = dice->only >= 0 ? 1 : dice->films;
    t.films = calloc((size_t)t.count, sizeof *t.films);
    enum status status = t.films ? OK : fail(ERR_MEMORY, "no memory for the films");
    if (status == OK)
        status = dice->postures ? dice_motions_open_postures(&t.motions, dice->seed, POSTURE_MOTIONS)
                                : dice_motions_open(&t.motions, motions);
    if (status == OK) {
        const struct dice_request request = {
            .wish = {dice->seed, dice->seconds, &t.motions, dice->color, false},
            .first = dice->only >= 0 ? dice->only : 0,
            .count = t.count,
            .threads = dice->threads,
            .shown = isatty(STDERR_FILENO),
        };
        dice_films_make(t.films, &request);
    }
    for (int i = 0; i < t.count && status == OK; i++)
        if (t.films[i].failure.status != OK)
            status = fail(t.films[i].failure.status, "%s", t.films[i].failure.sentence);
    for (int mode = 0; mode < t.films[0].modes && status == OK; mode++)
        t.rig[mode] = dice_rig_of(t.films, t.count, (enum dice_mode)mode);
    if (status == OK)
        status = show(&t);
    if (status == OK && dice->dump)
        status = dice_dump_write(t.films, t.count, dice->dump);
    if (status == OK && dice->features)
        status = dice_features_write(t.films, t.count, dice->features);
    bench_columns(b, columns, COUNT_OF(columns));
    if (status == OK)
        status = add_rows(&t, "all", (struct dice_group){0});
    if (status == OK)
        status = add_causes(&t);
    for (int i = 0; t.films && i < t.count; i++)
        dice_film_free(&t.films[i]);
    free(t.films);
    dice_motions_close(&t.motions);
    return status;
}
