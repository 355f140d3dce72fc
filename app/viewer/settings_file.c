#include "app/viewer/settings_file.h"

#include "platform/files/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH_BYTES = 1024, MAX_BYTES = 4096 }; // a larger file is none of ours

bool settings_file_path(char *out, size_t capacity)
{
    const char *config = getenv("XDG_CONFIG_HOME"), *home = getenv("HOME");
    int length = 0;
    if (config && *config == '/') // relative ones are to be ignored, by the XDG base directory specification
        length = snprintf(out, capacity, "%s/reenact/settings", config);
    else if (home && *home == '/')
        length = snprintf(out, capacity, "%s/.config/reenact/settings", home);
    return length > 0 && (size_t)length < capacity;
}

void settings_file_read(const char *path, struct settings *settings, char *why, size_t capacity)
{
    uint8_t *bytes = NULL;
    size_t count = 0;
    char text[MAX_BYTES + 1];
    *why = 0;
    if (!file_exists(path))
        return;
    if (file_read(path, &bytes, &count) != OK) {
        snprintf(why, capacity, "%s", status_message());
        return;
    }
    const bool fits = count <= MAX_BYTES && !memchr(bytes, 0, count);
    if (fits) {
        memcpy(text, bytes, count);
        text[count] = 0;
    }
    free(bytes);
    const int wrong = fits ? settings_read(settings, text) : 1;
    if (wrong)
        snprintf(why, capacity, "%s holds what is no setting of this version; it is left out", path);
}

enum status settings_file_write(const char *path, const struct settings *settings)
{
    char folder[PATH_BYTES], text[SETTINGS_BYTES];
    snprintf(folder, sizeof folder, "%s", path);
    char *slash = strrchr(folder, '/');
    if (slash)
        *slash = 0;
    const enum status status = folder_make(folder);
    if (status != OK)
        return status;
    return file_write(path, text, (size_t)settings_write(settings, text));
}

void settings_keeper_open(struct settings_keeper *keeper, const char *path, struct settings *settings, bool light,
                          double text_size)
{
    char why[512] = "";
    if (path)
        settings_file_read(path, settings, why, sizeof why);
    if (*why)
        fprintf(stderr, "%s\n", why);
    settings->dark &= !light;
    settings->text_size = text_size > 0 ? text_size : settings->text_size;
    *keeper = (struct settings_keeper){.path = path, .kept = *settings};
}

void settings_keeper_update(struct settings_keeper *keeper, const struct settings *now)
{
    if (!keeper->path || keeper->fails || settings_equal(now, &keeper->kept))
        return;
    keeper->kept = *now;
    if (settings_file_write(keeper->path, now) == OK)
        return;
    keeper->fails = true;
    fprintf(stderr, "what is chosen is not kept: %s\n", status_message());
}
