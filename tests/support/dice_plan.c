#include "tests/support/dice_place.h"
#include "tests/world/posture.h"

#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const double dice_situation_share[DICE_SITUATIONS] = {
    [DICE_CLEAR] = 0.36,     [DICE_ENTERS] = 0.08,    [DICE_LEAVES] = 0.08,   [DICE_CUT_SIDE] = 0.10,
    [DICE_CUT_BELOW] = 0.10, [DICE_FURNITURE] = 0.14, [DICE_PASSERBY] = 0.14,
};

const char *dice_situation_name(enum dice_situation s)
{
    static const char *const names[DICE_SITUATIONS] = {"clear",     "enters",    "leaves",   "cut_side",
                                                       "cut_below", "furniture", "passer-by"};
    return names[s];
}

// ---------------------------------------------------------------- lists to draw from

void dice_motions_close(struct dice_motions *m)
{
    for (int i = 0; i < m->count; i++)
        free(m->name[i]);
    free(m->name);
    *m = (struct dice_motions){0};
}

static enum status add_motion(struct dice_motions *m, const char *name, size_t length)
{
    char **more = realloc(m->name, (size_t)(m->count + 1) * sizeof *more);
    if (more)
        m->name = more;
    if (!more || !(m->name[m->count] = strndup(name, length)))
        return fail(ERR_MEMORY, "no memory for the list of motions");
    m->count++;
    return OK;
}

// The `index`th word of a list separated by spaces; NULL behind the last.
static const char *word_at(const char *list, int index, size_t *length)
{
    for (; index > 0 && list; index--)
        if ((list = strchr(list, ' ')))
            list++;
    *length = list ? strcspn(list, " ") : 0;
    return list;
}

static int word_count(const char *list)
{
    int count = 1;
    while ((list = strchr(list, ' '))) {
        list++;
        count++;
    }
    return count;
}

enum status dice_motions_open(struct dice_motions *m, const char *folder)
{
    *m = (struct dice_motions){0};
    enum status status = OK;
    for (int i = 0; i < word_count(world_motion_names()) && status == OK; i++) {
        size_t length;
        const char *name = word_at(world_motion_names(), i, &length);
        status = add_motion(m, name, length);
    }
    if (folder && status == OK) {
        char pattern[4096];
        glob_t files;
        snprintf(pattern, sizeof pattern, "%s/*.bvh", folder);
        if (glob(pattern, 0, NULL, &files) || !files.gl_pathc)
            status = fail(ERR_MISSING, "%s: no BVH file is there", folder);
        for (size_t i = 0; status == OK && i < files.gl_pathc; i++)
            status = add_motion(m, files.gl_pathv[i], strlen(files.gl_pathv[i]));
        globfree(&files);
    }
    if (status != OK)
        dice_motions_close(m);
    return status;
}

enum status dice_motions_open_postures(struct dice_motions *m, uint64_t seed, int count)
{
    *m = (struct dice_motions){.stays = true};
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++) {
        char name[64];
        const int posture = POSTURE_SITTING + i % (POSTURES - POSTURE_SITTING);
        const int length = snprintf(name, sizeof name, "%s:%llu", posture_name((enum posture)posture),
                                    (unsigned long long)(seed * 1000 + (uint64_t)i));
        status = add_motion(m, name, (size_t)length);
    }
    if (status != OK)
        dice_motions_close(m);
    return status;
}

// ---------------------------------------------------------------- drawing

static enum dice_situation draw_situation(struct rng *rng)
{
    double at = rng_uniform(rng);
    int s = 0;
    while (s < DICE_SITUATIONS - 1 && at >= dice_situation_share[s])
        at -= dice_situation_share[s++];
    return (enum dice_situation)s;
}

static void draw_figure(struct rng *rng, struct dice_actor *actor)
{
    size_t length;
    const char *name = word_at(world_figure_names(), rng_pick(rng, word_count(world_figure_names())), &length);
    assert(length < sizeof actor->figure);
    memcpy(actor->figure, name, length);
    actor->figure[length] = 0;
}

// Which stretch of the motion the actor goes through, not yet placed. *seconds: at most, then of the stretch.
static enum status draw_stretch(struct rng *rng, const struct dice_plan *plan, struct dice_actor *actor,
                                const char *motion, double *seconds)
{
    actor->motion = motion;
    actor->spot = (struct world_spot){0};
    const struct world_options options = dice_world_options(plan, actor);
    double length;
    enum status status = world_preview_seconds(&options, &length);
    *seconds = fmin(*seconds, length);
    actor->start_s = rng_between(rng, 0, length - *seconds);
    return status;
}

static void draw_stand(struct rng *rng, struct world_stand *stand)
{
    *stand = world_default_options().stand;
    stand->eye.x = rng_between(rng, -0.4, 0.4);
    stand->eye.z = rng_between(rng, 0.6, 1.7);
    stand->target.x = stand->eye.x + rng_between(rng, -0.2, 0.2);
    stand->target.z = rng_between(rng, 0.75, 1.1);
    stand->roll = rng_between(rng, -0.03, 0.03);
}

// A second person, who crosses the actor's line of sight; the motions of the world that walk. NOTHING: found no way.
static enum status draw_passerby(struct rng *rng, struct dice_plan *plan, struct dice_scene *scene, double seconds)
{
    static const char *const walks[] = {"walk", "visit"};
    draw_figure(rng, &plan->passerby);
    const char *motion = walks[rng_pick(rng, COUNT_OF(walks))];
    enum status status = draw_stretch(rng, plan, &plan->passerby, motion, &seconds);
    if (status == OK)
        status = dice_preview(plan, &plan->passerby, scene->passerby);
    return status == OK ? dice_place_passerby(rng, plan, scene) : status;
}

// One try: a motion, its stretch, a place where the situation comes true. NOTHING: there is none.
static enum status draw_place(struct rng *rng, const struct dice_wish *wish, struct dice_plan *plan,
                              struct dice_scene *scene)
{
    const char *motion = wish->motions->name[rng_pick(rng, wish->motions->count)];
    double seconds = fmin(wish->seconds, (double)DICE_FRAMES_MOST / DICE_HZ);
    plan->boxes = 0;
    enum status status = draw_stretch(rng, plan, &plan->actor, motion, &seconds);
    plan->frames = (int)fmax(1, seconds * DICE_HZ);
    if (status == OK)
        status = dice_preview(plan, &plan->actor, scene->actor);
    if (status == OK)
        status = dice_place_actor(rng, plan, scene);
    if (status == OK && plan->situation == DICE_FURNITURE)
        status = dice_place_furniture(rng, plan, scene);
    if (status == OK && plan->situation == DICE_PASSERBY)
        status = draw_passerby(rng, plan, scene, seconds);
    return status;
}

enum status dice_plan_draw(struct dice_plan *out, const struct dice_wish *wish, int index)
{
    enum { TRIES = 1000 }; // few stretches of motions walk far enough to enter or to leave

    struct rng rng = rng_of(wish->seed, index);
    *out = (struct dice_plan){.seed = wish->seed, .noise_seed = rng.state, .index = index, .plain = wish->plain};
    out->situation = draw_situation(&rng);
    if (wish->motions->stays && (out->situation == DICE_ENTERS || out->situation == DICE_LEAVES))
        out->situation = DICE_CLEAR;
    out->scale = rng_uniform(&rng) < 0.25 ? 1 : 0.5;
    out->swept = rng_uniform(&rng) < 0.5;
    draw_figure(&rng, &out->actor);
    draw_stand(&rng, &out->stand);
    struct dice_scene *scene = calloc(1, sizeof *scene);
    enum status status = scene ? NOTHING : fail(ERR_MEMORY, "no memory for a film's plan");
    for (int i = 0; i < TRIES && status == NOTHING; i++)
        status = draw_place(&rng, wish, out, scene);
    free(scene);
    return status == NOTHING ? fail(ERR_INPUT, "film %d: none of the motions can be filmed as '%s'", index,
                                    dice_situation_name(out->situation))
                             : status;
}

struct world_options dice_world_options(const struct dice_plan *plan, const struct dice_actor *actor)
{
    struct world_options options = world_default_options();
    bool known = world_figure_named(actor->figure, &options.figure);
    assert(known);
    (void)known;
    if (actor->motion)
        options.motion = actor->motion;
    options.stand = plan->stand;
    options.spot = actor->spot;
    options.plain = plan->plain;
    options.boxes = plan->boxes;
    memcpy(options.box, plan->box, sizeof options.box);
    return options;
}
