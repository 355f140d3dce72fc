// reenact-capture devices: lists the sensors and cameras that can be opened.
#include "app/commands/commands.h"
#include "platform/files/installed.h"
#include "platform/files/json.h"
#include "platform/sensors/source.h"

#include <stdio.h>

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    bool *json = state->input;
    switch (key) {
    case COMMAND_KEY: *json = true; return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static int print_json(const char *program, const struct source_device *devices, int count)
{
    struct json *root = json_new_object(), *list = json_add_array(root, "devices");
    for (int i = 0; i < count; i++) {
        struct json *device = json_add_object(list, NULL);
        json_add_string(device, "uri", devices[i].uri);
        json_add_string(device, "name", devices[i].name);
    }
    return command_print_json(&root) == OK ? 0 : command_failed(program);
}

int capture_devices(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"json", COMMAND_KEY, NULL, 0, "print JSON: devices, each with uri and name", 0},
        {0},
    };
    static const struct argp argp = {
        .options = options,
        .parser = parse_option,
        .doc = "Lists the depth sensors and cameras that can be opened, by the URI that --sensor and --camera take."
               "\vNone is no error. Recordings (oni:FILE, mkv:FILE, r3d:FILE, stray:DIR) and folders of pictures "
               "(folder:DIR) can always be "
               "opened."};
    bool json = false;
    command_parse(&argp, argc, argv, &json);
    struct source_device devices[64];
    char text[INSTALLED_PATH_BYTES];
    int count;
    if (source_devices(devices, COUNT_OF(devices), &count) != OK)
        return command_failed(argv[0]);
    if (count > (int)COUNT_OF(devices))
        count = COUNT_OF(devices);
    if (json)
        return print_json(argv[0], devices, count);
    if (!count) {
        struct source *s;
        if (source_open(&s, "openni", SOURCE_SENSOR) == OK)
            source_close(&s); // plugged in just now
        else                  // says where drivers were looked for
            fprintf(stderr, "%s: %s; %s says what each sensor needs\n", argv[0], status_message(),
                    installed_text("sensors.md", text));
    }
    for (int i = 0; i < count; i++)
        printf("%-14s %s\n", devices[i].uri, devices[i].name);
    return 0;
}
