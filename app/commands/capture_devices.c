// reenact-capture devices: lists the sensors and cameras that can be opened, and the depth sensors that are plugged in
// and cannot.
#include "app/commands/commands.h"
#include "platform/files/installed.h"
#include "platform/files/json.h"
#include "platform/sensors/source.h"
#include "platform/sensors/usb_sensors.h"

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

struct devices {
    struct source_device usable[64];
    struct usb_sensor plugged[64]; // in, but not usable
    int usable_count, plugged_count;
};

static bool is_usable(const struct devices *devices, const struct usb_sensor *sensor)
{
    for (int i = 0; i < devices->usable_count; i++)
        if (devices->usable[i].usb_vendor == sensor->vendor && devices->usable[i].usb_product == sensor->product)
            return true;
    return false;
}

static enum status find_devices(struct devices *out)
{
    struct usb_sensor found[COUNT_OF(out->plugged)];
    int count;
    enum status status = source_devices(out->usable, COUNT_OF(out->usable), &out->usable_count);
    if (status == OK)
        status = usb_sensors_find(USB_DEVICES, USB_NODES, found, COUNT_OF(found), &count);
    if (status != OK)
        return status;
    if (out->usable_count > (int)COUNT_OF(out->usable))
        out->usable_count = COUNT_OF(out->usable);
    for (int i = 0; i < count && i < (int)COUNT_OF(found); i++)
        if (!is_usable(out, &found[i]))
            out->plugged[out->plugged_count++] = found[i];
    return OK;
}

static int print_json(const char *program, const struct devices *all)
{
    const struct source_device *devices = all->usable;
    const int count = all->usable_count;
    struct json *root = json_new_object(), *list = json_add_array(root, "devices");
    for (int i = 0; i < count; i++) {
        struct json *device = json_add_object(list, NULL);
        json_add_string(device, "uri", devices[i].uri);
        json_add_string(device, "name", devices[i].name);
    }
    list = json_add_array(root, "unusable");
    for (int i = 0; i < all->plugged_count; i++) {
        const struct usb_sensor *sensor = &all->plugged[i];
        struct json *device = json_add_object(list, NULL);
        char usb[16];
        snprintf(usb, sizeof usb, "%04x:%04x", sensor->vendor, sensor->product);
        json_add_string(device, "usb", usb);
        json_add_string(device, "name", sensor->name);
        json_add_string(device, "needs", sensor->needs);
    }
    return command_print_json(&root) == OK ? 0 : command_failed(program);
}

int capture_devices(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"json", COMMAND_KEY, NULL, 0,
         "print JSON: devices, each with uri and name; unusable, each with usb (its "
         "id), name and needs",
         0},
        {0},
    };
    static const struct argp argp = {
        .options = options,
        .parser = parse_option,
        .doc =
            "Lists the depth sensors and cameras that can be opened, by the URI that --sensor and --camera take; then "
            "the depth sensors that are plugged in and cannot be used, with what each needs."
            "\vNone is no error. Recordings (oni:FILE, mkv:FILE, r3d:FILE, stray:DIR) and folders of pictures "
            "(folder:DIR) can always be "
            "opened."};
    bool json = false;
    command_parse(&argp, argc, argv, &json);
    struct devices devices = {.usable_count = 0};
    char text[INSTALLED_PATH_BYTES];
    if (find_devices(&devices) != OK)
        return command_failed(argv[0]);
    if (json)
        return print_json(argv[0], &devices);
    if (!devices.usable_count && !devices.plugged_count) {
        struct source *s;
        if (source_open(&s, "openni", SOURCE_SENSOR) == OK)
            source_close(&s); // plugged in just now
        else                  // says where drivers were looked for
            fprintf(stderr, "%s: %s; %s says what each sensor needs\n", argv[0], status_message(),
                    installed_text("sensors.md", text));
    }
    for (int i = 0; i < devices.usable_count; i++)
        printf("%-14s %s\n", devices.usable[i].uri, devices.usable[i].name);
    for (int i = 0; i < devices.plugged_count; i++)
        printf("cannot be used: %s (USB %04x:%04x): it needs %s\n", devices.plugged[i].name, devices.plugged[i].vendor,
               devices.plugged[i].product, devices.plugged[i].needs);
    if (devices.plugged_count)
        printf("%s says more\n", installed_text("sensors.md", text));
    return 0;
}
