#include "app/start/shelf.h"

#include "platform/files/file.h"
#include "recording/recording.h"

#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

enum { ENTRIES_MAX = 500, VISITS_MAX = 20000, OPEN_FOLDERS = 8, DEPTH_MAX = 3 };

static const char ENDING[] = ".reenact";

// ---------------------------------------------------------------- the user's folders

// The line NAME="$HOME/…" or NAME="/…" of the user's list of folders (xdg-user-dirs).
static bool read_user_folder(const char *text, const char *name, const char *home, char *out, size_t capacity)
{
    const size_t length = strlen(name);
    for (const char *line = text; *line; line += strcspn(line, "\n"), line += *line == '\n') {
        if (strncmp(line, name, length) != 0 || strncmp(line + length, "=\"", 2) != 0)
            continue;
        const char *value = line + length + 2;
        const int bytes = (int)strcspn(value, "\"\n");
        const bool inside = !strncmp(value, "$HOME/", 6);
        if (inside)
            return snprintf(out, capacity, "%s/%.*s", home, bytes - 6, value + 6) < (int)capacity;
        return *value == '/' && snprintf(out, capacity, "%.*s", bytes, value) < (int)capacity;
    }
    return false;
}

// name: as in that list; usual: in the home folder, where the list does not say.
static bool user_folder(const char *name, const char *usual, char *out, size_t capacity)
{
    const char *home = getenv("HOME"), *config = getenv("XDG_CONFIG_HOME");
    char list[RECENT_PATH_BYTES];
    uint8_t *text = NULL;
    size_t count;
    if (!home || *home != '/')
        return false;
    if (config && *config == '/')
        snprintf(list, sizeof list, "%s/user-dirs.dirs", config);
    else
        snprintf(list, sizeof list, "%s/.config/user-dirs.dirs", home);
    bool found = file_exists(list) && file_read(list, &text, &count) == OK &&
                 read_user_folder((const char *)text, name, home, out, capacity);
    free(text);
    if (!found)
        found = snprintf(out, capacity, "%s/%s", home, usual) < (int)capacity;
    return found;
}

bool shelf_film_folder(char *out, size_t capacity)
{
    char films[RECENT_PATH_BYTES];
    return user_folder("XDG_VIDEOS_DIR", "Videos", films, sizeof films) &&
           snprintf(out, capacity, "%s/Reenact", films) < (int)capacity;
}

// ---------------------------------------------------------------- finding

static bool has_ending(const char *path)
{
    const size_t length = strlen(path);
    return length >= sizeof ENDING && !strcmp(path + length - (sizeof ENDING - 1), ENDING);
}

static enum status add_entry(struct shelf *shelf, const char *path, int64_t time_s)
{
    const char *slash = strrchr(path, '/');
    if (shelf->count >= ENTRIES_MAX || strlen(path) >= RECENT_PATH_BYTES)
        return OK;
    for (int i = 0; i < shelf->count; i++)
        if (!strcmp(shelf->entries[i].path, path)) {
            if (time_s > shelf->entries[i].time_s)
                shelf->entries[i].time_s = time_s;
            shelf->entries[i].recent = false;
            return OK;
        }
    struct shelf_entry *grown = realloc(shelf->entries, sizeof *grown * ((size_t)shelf->count + 1));
    if (!grown)
        return fail(ERR_MEMORY, "no memory to list the recordings");
    shelf->entries = grown;
    struct shelf_entry *entry = &grown[shelf->count++];
    *entry = (struct shelf_entry){.time_s = time_s};
    snprintf(entry->path, sizeof entry->path, "%s", path);
    snprintf(entry->name, sizeof entry->name, "%s", slash ? slash + 1 : path);
    if (has_ending(entry->name))
        entry->name[strlen(entry->name) - (sizeof ENDING - 1)] = 0;
    return OK;
}

// nftw has no context: one search at a time, on the GPU's thread.
static struct {
    struct shelf *shelf;
    enum status status;
    int visits;
} search;

static int visit(const char *path, const struct stat *about, int kind, struct FTW *at)
{
    if (++search.visits > VISITS_MAX)
        return 1;
    if (kind == FTW_D && (at->level > DEPTH_MAX || (at->level > 0 && path[at->base] == '.')))
        return FTW_SKIP_SUBTREE;
    if (kind == FTW_F && has_ending(path))
        search.status = add_entry(search.shelf, path, (int64_t)about->st_mtime);
    return search.status == OK ? FTW_CONTINUE : FTW_STOP;
}

static enum status add_folder(struct shelf *shelf, const char *folder)
{
    search.shelf = shelf;
    search.status = OK;
    if (file_exists(folder))
        (void)nftw(folder, visit, OPEN_FOLDERS, FTW_PHYS | FTW_ACTIONRETVAL | FTW_MOUNT);
    return search.status;
}

static enum status add_recents(struct shelf *shelf, const char *file)
{
    struct recent_list *list = malloc(sizeof *list);
    enum status status = list ? OK : fail(ERR_MEMORY, "no memory to list the recordings");
    if (list)
        recent_read(file, list);
    for (int i = 0; status == OK && i < list->count; i++)
        if (file_exists(list->at[i].path))
            status = add_entry(shelf, list->at[i].path, list->at[i].opened_s);
    for (int i = 0; i < shelf->count; i++)
        shelf->entries[i].recent = true;
    free(list);
    return status;
}

static enum status add_user_folders(struct shelf *shelf)
{
    static const struct {
        const char *name, *usual;
    } folders[] = {{"XDG_VIDEOS_DIR", "Videos"},
                   {"XDG_DOCUMENTS_DIR", "Documents"},
                   {"XDG_DOWNLOAD_DIR", "Downloads"},
                   {"XDG_DESKTOP_DIR", "Desktop"}};
    const char *user = getenv("USER"), *const sticks[] = {"/media", "/run/media"};
    char folder[RECENT_PATH_BYTES];
    enum status status = OK;
    search.visits = 0;
    for (size_t i = 0; i < COUNT_OF(folders) && status == OK; i++)
        if (user_folder(folders[i].name, folders[i].usual, folder, sizeof folder))
            status = add_folder(shelf, folder);
    for (size_t i = 0; i < COUNT_OF(sticks) && status == OK && user; i++) {
        snprintf(folder, sizeof folder, "%s/%s", sticks[i], user);
        status = add_folder(shelf, folder);
    }
    return status;
}

static int by_time(const void *a, const void *b)
{
    const struct shelf_entry *one = a, *other = b;
    if (one->time_s != other->time_s)
        return one->time_s < other->time_s ? 1 : -1;
    return strcmp(one->path, other->path);
}

enum status shelf_open(struct shelf *out, const char *recents)
{
    *out = (struct shelf){0};
    enum status status = recents ? add_recents(out, recents) : OK;
    if (status == OK)
        status = add_user_folders(out);
    if (status != OK) {
        shelf_close(out);
        return status;
    }
    if (out->count)
        qsort(out->entries, (size_t)out->count, sizeof *out->entries, by_time);
    return OK;
}

void shelf_close(struct shelf *shelf)
{
    for (int i = 0; i < shelf->count; i++)
        take_list_close(&shelf->entries[i].takes);
    free(shelf->entries);
    *shelf = (struct shelf){0};
}

// ---------------------------------------------------------------- loading

static void put_words(struct shelf_entry *entry)
{
    char date[64] = "";
    struct tm day;
    struct stat about;
    if (stat(entry->path, &about) == 0 && localtime_r(&about.st_mtime, &day))
        strftime(date, sizeof date, " · %e %B %Y", &day);
    const int count = entry->takes.count;
    if (count == 1)
        snprintf(entry->words, sizeof entry->words, "one take%s", date);
    else
        snprintf(entry->words, sizeof entry->words, "%d takes%s", count, date);
    if (!count)
        snprintf(entry->words, sizeof entry->words, "no take yet%s", date);
    entry->usable = count > 0;
}

static enum status load(struct shelf_entry *entry, struct gpu *gpu)
{
    struct recording *recording;
    enum status status = recording_open(&recording, entry->path);
    entry->loaded = true;
    if (status == OK) {
        status = take_list_open(&entry->takes, recording, entry->path);
        if (status == OK && entry->takes.count)
            status = take_list_load(&entry->takes, gpu, recording, 0, 1);
        recording_free(&recording);
    }
    if (status == ERR_MEMORY || status == ERR_DEVICE)
        return status;
    if (status == OK)
        put_words(entry);
    else
        snprintf(entry->words, sizeof entry->words, "cannot be read");
    return OK;
}

enum status shelf_load(struct shelf *shelf, struct gpu *gpu, int first, int end)
{
    for (int i = first; i < end && i < shelf->count; i++)
        if (!shelf->entries[i].loaded)
            return load(&shelf->entries[i], gpu);
    return NOTHING;
}
