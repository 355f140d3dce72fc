// reenact-capture info FILE: what a recording holds.
#include "app/commands/commands.h"
#include "app/commands/take_summary.h"
#include "base/text.h"
#include "capture/take_verdict.h"
#include "platform/files/json.h"
#include "recording/recorded_things.h"

#include <stdio.h>
#include <sys/stat.h>

// ------------------------------------------------------------- for people

static void print_size(const char *what, const struct lens *lens)
{
    if (lens->width)
        printf(", %s %d x %d", what, lens->width, lens->height);
    else
        printf(", no %s", what);
}

static void print_place(const struct place *place)
{
    printf("place: %d tags, %d points, %d views, residuals %.2f px", place->tag_count, place->point_count,
           place->view_count, place->rms_px);
    if (place->rms_m > 0)
        printf(" and %.1f mm", place->rms_m * 1e3);
    putchar('\n');
    for (int32_t i = 0; i < place->tag_count; i++) {
        const struct place_tag *t = &place->tags[i];
        struct vec3 at = t->world_from_tag.translation;
        printf("  tag %d: side %.1f mm at %.3f %.3f %.3f m, %.2f px over %d observations\n", t->id, t->side_m * 1e3,
               at.x, at.y, at.z, t->rms_px, t->observations);
    }
}

static double sigma_m(const struct recorded_thing *thing) { return sqrt(covariance3_trace(&thing->covariance)); }

static void print_thing(const struct recorded_thing *thing)
{
    const struct vec3 at = thing->world_from_thing.translation;
    printf("thing '%s': at %.3f %.3f %.3f m", thing->name, at.x, at.y, at.z);
    if (sigma_m(thing) > 0)
        printf(", to %.1f mm", sigma_m(thing) * 1e3);
    printf("%s\n", thing->gone ? ", gone" : "");
}

static void print_sizes(const struct take_sizes *sizes, double duration_s)
{
    const double all = (double)(sizes->color + sizes->depth + sizes->mask + sizes->joints);
    printf("  %s%.1f MB: colour %.1f, depth %.1f, masks %.1f, joints %.1f", sizes->exact ? "" : "about ", all / 1e6,
           (double)sizes->color / 1e6, (double)sizes->depth / 1e6, (double)sizes->mask / 1e6,
           (double)sizes->joints / 1e6);
    if (duration_s > 0)
        printf("; %.0f MB a minute", all / 1e6 * 60 / duration_s);
    putchar('\n');
}

static void print_take(const struct take_summary *summary, const struct take_sizes *sizes,
                       const struct take_verdict *verdict)
{
    char text[VERDICT_TEXT_BYTES];
    printf("take '%s': %lld frames, %.1f s", summary->name, (long long)summary->frames, summary->duration_s);
    if (summary->fps > 0)
        printf(" at %.1f Hz", summary->fps);
    print_size("colour", &summary->calibration->color);
    print_size("depth", &summary->calibration->depth);
    printf("\n  skeleton in %lld, ", (long long)summary->with_skeleton);
    if (summary->with_color < summary->frames && summary->calibration->color.width)
        printf("colour in %lld, ", (long long)summary->with_color);
    if (summary->with_depth < summary->frames && summary->calibration->depth.width)
        printf("depth in %lld, ", (long long)summary->with_depth);
    printf("located in %lld, ", (long long)summary->located);
    if (summary->representative >= 0)
        printf("representative frame %lld, ", (long long)summary->representative);
    else
        printf("no representative frame, ");
    printf("%lld dropped, ", (long long)summary->dropped);
    if (summary->lost)
        printf("%lld lost to damage, ", (long long)summary->lost);
    puts(summary->complete ? "complete" : "interrupted");
    print_sizes(sizes, summary->duration_s);
    printf("  verdict: %s\n", verdict_text(verdict, text));
    if (*summary->alias)
        printf("  performed by %s\n", summary->alias);
    if (*summary->note)
        printf("  note: %s\n", summary->note);
}

// ------------------------------------------------------------- for programs

static void add_point(struct json *parent, const char *name, struct vec3 p)
{
    struct json *at = json_add_array(parent, name);
    json_push_number(at, p.x);
    json_push_number(at, p.y);
    json_push_number(at, p.z);
}

static void add_place(struct json *root, const struct place *p)
{
    struct json *place = json_add_object(root, "place");
    json_add_number(place, "rms_px", p->rms_px);
    json_add_number(place, "rms_m", p->rms_m);
    json_add_number(place, "points", p->point_count);
    json_add_number(place, "views", p->view_count);
    struct json *tags = json_add_array(place, "tags");
    for (int32_t i = 0; i < p->tag_count; i++) {
        const struct place_tag *t = &p->tags[i];
        struct json *tag = json_add_object(tags, NULL);
        json_add_number(tag, "id", t->id);
        json_add_number(tag, "side_m", t->side_m);
        json_add_number(tag, "rms_px", t->rms_px);
        json_add_number(tag, "sightings", t->observations);
        add_point(tag, "position_m", t->world_from_tag.translation);
        struct vec3 corners[4];
        place_tag_corners(t, corners);
        struct json *list = json_add_array(tag, "corners_m");
        for (int k = 0; k < 4; k++)
            add_point(list, NULL, corners[k]);
    }
}

static void add_thing(struct json *things, const struct recorded_thing *recorded_thing)
{
    struct json *thing = json_add_object(things, NULL);
    json_add_string(thing, "name", recorded_thing->name);
    add_point(thing, "position_m", recorded_thing->world_from_thing.translation);
    json_add_number(thing, "sigma_m", sigma_m(recorded_thing));
    json_add_number(thing, "sightings", recorded_thing->sightings);
    json_add_bool(thing, "gone", recorded_thing->gone);
}

static void add_take(struct json *takes, const struct take_summary *summary, const struct take_sizes *sizes,
                     const struct take_verdict *verdict)
{
    struct json *take = json_add_object(takes, NULL);
    json_add_string(take, "name", summary->name);
    json_add_bool(take, "complete", summary->complete);
    json_add_number(take, "frames", (double)summary->frames);
    json_add_number(take, "duration_s", summary->duration_s);
    json_add_number(take, "fps", summary->fps);
    json_add_number(take, "color_width", summary->calibration->color.width);
    json_add_number(take, "color_height", summary->calibration->color.height);
    json_add_number(take, "depth_width", summary->calibration->depth.width);
    json_add_number(take, "depth_height", summary->calibration->depth.height);
    json_add_number(take, "frames_with_skeleton", (double)summary->with_skeleton);
    json_add_number(take, "frames_located", (double)summary->located);
    json_add_number(take, "representative_frame", (double)summary->representative);
    json_add_number(take, "dropped", (double)summary->dropped);
    json_add_number(take, "lost", (double)summary->lost);
    json_add_number(take, "frames_with_color", (double)summary->with_color);
    json_add_number(take, "frames_with_depth", (double)summary->with_depth);
    struct json *bytes = json_add_object(take, "bytes");
    json_add_number(bytes, "color", (double)sizes->color);
    json_add_number(bytes, "depth", (double)sizes->depth);
    json_add_number(bytes, "masks", (double)sizes->mask);
    json_add_number(bytes, "joints", (double)sizes->joints);
    json_add_string(take, "alias", summary->alias);
    json_add_string(take, "note", summary->note);
    verdict_add_json(take, verdict);
}

// ------------------------------------------------------------- the command

// Prints text, or adds to `takes` where it is not NULL. A take that cannot be read gets a warning.
static enum status report_take(struct recording *recording, const char *name, struct json *takes)
{
    struct take *take;
    struct take_sizes sizes;
    struct take_verdict verdict;
    enum status status = take_open(&take, recording, name);
    if (status == OK)
        status = take_read_sizes(take, &sizes);
    if (status == OK)
        status = take_verdict_get(recording, name, NULL, &verdict);
    if (status == ERR_CORRUPT) {
        fprintf(stderr, "reenact-capture info: warning: take '%s': %s\n", name, status_message());
        take_close(&take);
        return OK;
    }
    if (status == OK) {
        const struct take_summary summary = take_summarize(take, name);
        if (takes)
            add_take(takes, &summary, &sizes, &verdict);
        else
            print_take(&summary, &sizes, &verdict);
    }
    take_close(&take);
    return status;
}

// Prints text, or fills `root` where it is not NULL. Things that cannot be read get a warning.
static enum status report_things(struct recording *recording, struct json *root)
{
    struct recorded_thing *things;
    int count;
    const enum status status = recording_read_things(recording, &things, &count);
    if (status == ERR_CORRUPT)
        fprintf(stderr, "reenact-capture info: warning: %s\n", status_message());
    else if (status != OK)
        return status;
    struct json *list = root ? json_add_array(root, "things") : NULL;
    for (int i = 0; i < count; i++) {
        if (root)
            add_thing(list, &things[i]);
        else
            print_thing(&things[i]);
    }
    recorded_things_free(&things, count);
    return OK;
}

// Prints text, or fills `root` where it is not NULL.
static enum status report_recording(struct recording *recording, const char *path, struct json *root)
{
    struct stat about;
    char shown[TEXT_SHOWN_BYTES];
    double bytes = stat(path, &about) ? 0 : (double)about.st_size;
    struct place place;
    enum status status = recording_read_place(recording, &place);
    if (status == ERR_CORRUPT) // the takes can be listed all the same
        fprintf(stderr, "reenact-capture info: warning: %s\n", status_message());
    else if (status != OK && status != NOTHING)
        return status;
    if (root) {
        json_add_string(root, "file", path);
        json_add_number(root, "bytes", bytes);
    } else {
        printf("%s: %.1f MB\n", text_shown(path, shown), bytes / 1e6);
    }
    if (status == OK) {
        if (root)
            add_place(root, &place);
        else
            print_place(&place);
        if (place.views_lost || place.errors_lost)
            fprintf(stderr,
                    "reenact-capture info: warning: parts of the place are damaged; try reenact-capture repair\n");
        place_free(&place);
    } else if (!root) {
        printf("no place\n");
    }
    status = report_things(recording, root);
    struct json *takes = root ? json_add_array(root, "takes") : NULL;
    if (status == OK && root && !takes)
        status = fail(ERR_MEMORY, "no memory to list the takes");
    if (!root && !recording_take_count(recording))
        printf("no take\n");
    for (int i = 0; i < recording_take_count(recording) && status == OK; i++)
        status = report_take(recording, recording_take_name(recording, i), takes);
    return status;
}

int capture_info(int argc, char **argv)
{
    struct file_arguments a;
    command_parse_file(argc, argv, "Says what a recording holds: its place, its takes, its size.", &a);
    struct recording *r;
    if (recording_open(&r, a.path) != OK)
        return command_failed(argv[0]);
    struct json *root = NULL;
    enum status status = a.json ? command_begin_json(&root) : OK;
    if (status == OK)
        status = report_recording(r, a.path, root);
    if (status == OK && root)
        status = command_print_json(&root);
    json_free(&root);
    recording_free(&r);
    return status == OK ? 0 : command_failed(argv[0]);
}
