// The bench: error against time. A stage runs its contenders (our own settings, and what a user would take instead)
// over the same items, interleaved: item 1 by A, by B, by C, item 2 by A ..., for several rounds, so that disturbances
// of the machine affect all contenders alike. An item's time is the median over the rounds; the table has the median
// and the 95th percentile over the items.
//
// To add a stage, write bench_NAME.c with
//
//     static enum status run(struct bench *b)
//     {
//         ... make or read the items (bench_data) ...
//         const struct bench_contender contenders[] = {
//             {"ours", measure_ours, &ours},
//             {"OpenCV's", measure_opencv, &opencv, .baseline = true},
//         };
//         return bench_run(b, contenders, COUNT_OF(contenders), item_count);
//     }
//     const struct bench_stage bench_stage_NAME = {
//         "NAME", "one line", "error_mm", "time_ms", {"rejected"}, run};
//
// its line in bench_stages.h and, for a section of the page, one in bench_sections.h. A foreign library goes into a
// bench_NAME_*.cpp of its own, behind a plain C header. One thread; nothing but the small world's brief take
// (bench_views_data.h) is kept between stages.
#pragma once
#include "base/status.h"

enum { BENCH_EXTRAS = 6 };

struct bench; // one run of one stage

// A contender's result on one item.
struct bench_measure {
    double error;               // smaller is better
    double time_ms;             // of the work itself, by bench_clock_ms
    double extra[BENCH_EXTRAS]; // as the stage names them; the table has their means
};

struct bench_contender {
    const char *name;
    // OK: *out filled. NOTHING: no answer for this item; counted as missed, but its time counts. An error ends the
    // bench.
    enum status (*measure)(void *self, int item, struct bench_measure *out);
    void *self;
    bool baseline; // what a user would take instead: exactly one per stage
};

struct bench_stage {
    const char *name, *about;
    const char *error_name, *time_name;    // with the unit: "bits_per_pixel", "encode_ms"
    const char *extra_names[BENCH_EXTRAS]; // those that are not NULL
    enum status (*run)(struct bench *b);
};

// Processor time of this thread, so that other programs do not count.
double bench_clock_ms(void);
// The same for all threads of the program together.
double bench_all_threads_ms(void);

// Sorts `values`. Linear interpolation between neighbours; NaN for none.
double bench_percentile(double *values, int count, double share);

// skeleton: random short films.
struct bench_dice {
    int films; // 0: none
    uint64_t seed;
    int only; // the film with this index alone; -1: all
    double seconds;
    int threads;
    bool color;           // also with body points of the colour images
    bool postures;        // people who sit, kneel, lie or prop themselves up, instead of the world's motions
    const char *strip;    // a folder for strips of images of the worst films, or of the only one; NULL: none
    const char *dump;     // a CSV file of all joints; NULL: none
    const char *features; // a CSV file of what errors are judged by; NULL: none
};

enum { BENCH_FOLDERS = 16 };
struct bench_folders {
    const char *path[BENCH_FOLDERS];
    int count;
};

// A stage's input from the command line, of which at most one is set, but `motions` together with `dice`; and a file to
// write.
struct bench_inputs {
    const char *data;           // a folder (TUM layout); NULL: the stage makes its own items
    const char *motions;        // skeleton: a folder of BVH files, to be rendered in the small world
    const char *joints;         // skeleton: a folder as for `data`, evaluated joint by joint
    const char *sequences;      // skeleton: a folder of folders with joints_kinect_sdk.csv in truth/
    struct bench_folders empty; // skeleton: folders of images of rooms without a person
    bool bodies;                // skeleton: figures of all sizes and clothes in the small world
    struct bench_dice dice;
    bool json;           // the output is read by a program: stages print nothing themselves
    bool brief;          // for the page: fewer items, so that all stages together take minutes
    const char *plot;    // levels: an SVG file to write; NULL: none
    const char *answers; // stability: a file to store the answers in; NULL: none
};
const struct bench_inputs *bench_inputs(const struct bench *b);
// So many items, or a share of them (0..1) for the page; at least two.
int bench_count(const struct bench *b, int usual, double share);

// Where a stage whose results are no contenders writes its report to (bench_page.h). Once asked for, nothing else is
// printed for it.
struct bench_page;
const struct bench_page *bench_report_to(struct bench *b);

// A picture for the page: RGB, width * height. At most BENCH_PICTURES a stage; copied. Nothing where no page is made.
// A plain table's columns come first.
enum { BENCH_PICTURES = 4 };
void bench_picture(struct bench *b, const char *caption, const uint8_t *rgb, int width, int height);

// At most once in a stage. Names must live until the program ends. Errors:
// those of the contenders; ERR_MEMORY.
MUST_CHECK enum status bench_run(struct bench *b, const struct bench_contender *contenders, size_t count, int items);

// The items in groups, each of which gets table rows of its own.
struct bench_groups {
    const char *const *names; // of each group
    int count;
    const int *of_item; // the group of each item
};
// The same with groups.
MUST_CHECK enum status bench_run_grouped(struct bench *b, const struct bench_contender *contenders, size_t count,
                                         int items, const struct bench_groups *groups);

// Instead of bench_run, where there is nothing to compare with: a plain table, its columns first. The column names must
// live until the program ends; `name` is copied.
enum { BENCH_COLUMNS = 24 };
void bench_columns(struct bench *b, const char *const *names, size_t count);
// values: one a column, NaN for none. ERR_MEMORY.
MUST_CHECK enum status bench_add_row(struct bench *b, const char *name, const double *values);
