// No two files depend on each other, directly or through others: no header includes itself in the end, and no two
// object files call each other. Read from the sources, from the rooms' libraries and from the commands' objects.
#include "tests/support/test.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_NODES = 700, MOST_SYMBOLS = 30000 };

struct graph {
    char name[MOST_NODES][128];
    int count;
    bool edge[MOST_NODES][MOST_NODES]; // [from][to]
};

static int node_of(struct graph *g, const char *name)
{
    for (int i = 0; i < g->count; i++)
        if (!strcmp(g->name[i], name))
            return i;
    assert_true(g->count < MOST_NODES && strlen(name) < sizeof g->name[0]);
    strcpy(g->name[g->count], name);
    return g->count++;
}

static void add_edge(struct graph *g, int from, int to)
{
    if (from != to)
        g->edge[from][to] = true;
}

// Prints each group of nodes that reach each other, and says how many groups there are.
static int count_cycles(struct graph *g)
{
    int cycles = 0;
    for (int via = 0; via < g->count; via++) // Warshall: g->edge becomes "reaches"
        for (int from = 0; from < g->count; from++)
            if (g->edge[from][via])
                for (int to = 0; to < g->count; to++)
                    g->edge[from][to] |= g->edge[via][to];
    bool printed[MOST_NODES] = {false};
    for (int i = 0; i < g->count; i++) {
        if (!g->edge[i][i] || printed[i])
            continue;
        cycles++;
        print_error("a cycle:");
        for (int k = i; k < g->count; k++)
            if (k == i || (g->edge[i][k] && g->edge[k][i])) {
                print_error(" %s", g->name[k]);
                printed[k] = true;
            }
        print_error("\n");
    }
    return cycles;
}

// ---------------------------------------------------------------- includes

static void add_file(struct graph *g, const char *path)
{
    char full[1024], line[1024], name[512];
    snprintf(full, sizeof full, "%s/%s", SOURCE_DIR, path);
    const int from = node_of(g, path);
    FILE *file = fopen(full, "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file))
        if (sscanf(line, " # include \"%511[^\"]\"", name) == 1)
            add_edge(g, from, node_of(g, name));
    fclose(file);
}

static void add_folder(struct graph *g, const char *folder)
{
    char full[1024], path[512];
    snprintf(full, sizeof full, "%s/%s", SOURCE_DIR, folder);
    DIR *dir = opendir(full);
    assert_non_null(dir);
    for (struct dirent *entry; (entry = readdir(dir));) {
        const char *dot = strrchr(entry->d_name, '.');
        if (entry->d_name[0] == '.')
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        if (entry->d_type == DT_DIR)
            add_folder(g, path);
        else if (dot && !strcmp(dot, ".h"))
            add_file(g, path);
    }
    closedir(dir);
}

static void test_no_header_includes_itself(void **state)
{
    (void)state;
    struct graph *g = calloc(1, sizeof *g);
    assert_non_null(g);
    static const char *const rooms[] = {"base",    "platform", "recording", "neural",  "formats",  "locate",
                                        "objects", "capture",  "compare",   "reenact", "surround", "app"};
    for (size_t i = 0; i < COUNT_OF(rooms); i++)
        add_folder(g, rooms[i]);
    EXPECT_AT_LEAST(g->count, 120);
    EXPECT_INT(count_cycles(g), 0);
    free(g);
}

// ---------------------------------------------------------------- calls

struct symbol {
    char name[128];
    int object;
    bool defined;
};

static int by_name(const void *a, const void *b)
{
    const struct symbol *x = a, *y = b;
    const int order = strcmp(x->name, y->name);
    return order ? order : (int)y->defined - (int)x->defined; // the definition comes first
}

// A line of nm, LIBRARY[OBJECT]: SYMBOL TYPE …, or FOLDER/OBJECT: SYMBOL TYPE … False: another one.
static bool read_symbol(const char *line, char file[256], char name[1024], char *type)
{
    const char *inside = strchr(line, '['), *colon = strchr(line, ':');
    if (inside && inside < colon)
        return sscanf(inside, "[%255[^]]]: %1023s %c", file, name, type) == 3;
    while (colon && colon > line && colon[-1] != '/')
        colon--;
    return colon && sscanf(colon, "%255[^:]: %1023s %c", file, name, type) == 3;
}

// Adds what that nm says to the first `count` symbols. Returns how many there are then.
static int read_symbols(struct graph *g, const char *command, struct symbol *symbols, int count)
{
    FILE *nm = popen(command, "r");
    assert_non_null(nm);
    char line[4096], file[256], name[1024], type;
    while (fgets(line, sizeof line, nm)) {
        if (!read_symbol(line, file, name, &type) || strlen(name) >= sizeof symbols->name)
            continue; // of C++ libraries' templates
        assert_true(count < MOST_SYMBOLS);
        strcpy(symbols[count].name, name);
        symbols[count].object = node_of(g, file);
        symbols[count++].defined = type != 'U' && type != 'w' && type != 'v';
    }
    EXPECT_INT(pclose(nm), 0);
    return count;
}

static void test_no_files_call_each_other(void **state)
{
    (void)state;
    struct graph *g = calloc(1, sizeof *g);
    struct symbol *symbols = malloc(sizeof *symbols * MOST_SYMBOLS);
    assert_non_null(g);
    assert_non_null(symbols);
    int count = read_symbols(g, "nm -A -P -g " LIBRARIES " 2>/dev/null", symbols, 0);
    const int rooms = count;
    count = read_symbols(g, "nm -A -P -g " OBJECTS " 2>/dev/null", symbols, count);
    EXPECT_AT_LEAST(count - rooms, 1000);
    qsort(symbols, (size_t)count, sizeof *symbols, by_name);
    int definer = -1;
    for (int i = 0; i < count; i++) {
        if (!i || strcmp(symbols[i].name, symbols[i - 1].name))
            definer = symbols[i].defined ? symbols[i].object : -1;
        if (definer >= 0 && !symbols[i].defined)
            add_edge(g, symbols[i].object, definer);
    }
    print_message("%d objects, %d symbols\n", g->count, count);
    EXPECT_AT_LEAST(g->count, 100);
    EXPECT_AT_LEAST(count, 1000);
    EXPECT_INT(count_cycles(g), 0);
    free(symbols);
    free(g);
}

// The check itself, on a graph with one cycle of three and a chain.
static void test_a_cycle_is_found(void **state)
{
    (void)state;
    struct graph *g = calloc(1, sizeof *g);
    assert_non_null(g);
    const int a = node_of(g, "a"), b = node_of(g, "b"), c = node_of(g, "c"), d = node_of(g, "d");
    add_edge(g, a, b);
    add_edge(g, b, c);
    add_edge(g, c, d);
    EXPECT_INT(count_cycles(g), 0);
    add_edge(g, c, a);
    EXPECT_INT(count_cycles(g), 1);
    free(g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_header_includes_itself),
        cmocka_unit_test(test_no_files_call_each_other),
        cmocka_unit_test(test_a_cycle_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
