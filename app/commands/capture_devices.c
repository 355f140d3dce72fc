#include "app/commands/commands.h"

#include "platform/json.h"
#include "platform/source.h"

#include <stdio.h>
#include <stdlib.h>

static error_t parse(int key, char *value, struct argp_state *state)
{
    (void)value;
    bool *json = state->input;
    if (key == COMMAND_KEY)
        *json = true;
    else if (key == ARGP_KEY_ARG)
        argp_error(state, "devices takes no arguments");
    else
        return ARGP_ERR_UNKNOWN;
    return 0;
}

static int print_json(const char *program, const struct source_device *devices, int count)
{
    struct json *root = json_new_object(), *list = json_add_array(root, "devices");
    for (int i = 0; i < count; i++) {
        struct json *device = json_add_object(list, NULL);
        json_add_string(device, "uri", devices[i].uri);
        json_add_string(device, "name", devices[i].name);
    }
    char *text = json_print(root);
    json_free(&root);
    if (!text) {
        fail(ERR_MEMORY, "no memory to print the devices");
        return command_failed(program);
    }
    fputs(text, stdout);
    free(text);
    return 0;
}

int capture_devices(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"json", COMMAND_KEY, NULL, 0, "print JSON: devices, each with uri and name", 0},
        {0},
    };
    static const struct argp argp = {
        .options = options,
        .parser = parse,
        .doc = "Lists the depth sensors and cameras that can be opened, by the URI that --sensor and --camera take."
               "\vNone is no error. Recordings (oni:FILE) and folders of pictures (folder:DIR) can always be opened."};
    bool json = false;
    argp_parse(&argp, argc, argv, 0, NULL, &json);
    struct source_device devices[64];
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
        else
            fprintf(stderr, "%s: %s\n", argv[0], status_message()); // where drivers were looked for
    }
    for (int i = 0; i < count; i++)
        printf("%-14s %s\n", devices[i].uri, devices[i].name);
    return 0;
}
