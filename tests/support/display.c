#include "tests/support/test.h"

#include "tests/support/display.h"

#include "base/clock.h"
#include "platform/files/file.h"
#include "tests/support/process.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <xcb/xcb.h>
#include <xcb/xcbext.h>

// ---------------------------------------------------------------- the server and its screen

static int number(void)
{
    static int started; // one process may have several, one after the other
    return 1000 + ((int)getpid() + 7919 * started++) % 50000;
}

bool display_open(struct display *d, const char *folder, int width, int height)
{
    static const int64_t PATIENCE_NS = 60000000000; // on a machine that is busy
    char name[16], screen[32];
    *d = (struct display){.width = width, .height = height, .rgb = malloc((size_t)width * (size_t)height * 3)};
    snprintf(name, sizeof name, ":%d", number());
    snprintf(screen, sizeof screen, "%dx%dx24", width, height);
    snprintf(d->frame_buffer, sizeof d->frame_buffer, "%s/Xvfb_screen0", folder);
    const char *const arguments[] = {
        "/usr/bin/Xvfb", name,        "-screen", "0",        screen, "-fbdir",
        folder,          "-nolisten", "tcp",     "-noreset", NULL}; // no reset when the last window closes
    d->server = process_start(arguments);
    setenv("DISPLAY", name, 1);
    bool ready = false;
    for (const int64_t until = clock_now_ns() + PATIENCE_NS; !ready && clock_now_ns() < until;) {
        clock_sleep_until_ns(clock_now_ns() + 50000000);
        if (waitpid(d->server, NULL, WNOHANG) == d->server) { // it has ended
            d->server = 0;
            return false;
        }
        ready = display_read(d);
    }
    return ready;
}

void display_close(struct display *d)
{
    if (d->connection)
        xcb_disconnect(d->connection);
    if (d->server) {
        kill(d->server, SIGTERM);
        waitpid(d->server, NULL, 0);
        remove(d->frame_buffer);
    }
    free(d->rgb);
    *d = (struct display){0};
}

// Xvfb keeps its frame buffer in a file, xwd format.
bool display_read(struct display *d)
{
    const size_t w = (size_t)d->width, h = (size_t)d->height;
    uint8_t *bytes;
    size_t count;
    if (file_read(d->frame_buffer, &bytes, &count) != OK)
        return false;
    uint32_t head[25];
    bool whole = count > sizeof head;
    for (size_t i = 0; i < COUNT_OF(head) && whole; i++)
        head[i] = (uint32_t)bytes[4 * i] << 24 | (uint32_t)bytes[4 * i + 1] << 16 | (uint32_t)bytes[4 * i + 2] << 8 |
                  bytes[4 * i + 3];
    const size_t start = whole ? head[0] + 12 * (size_t)head[19] : 0, row = whole ? head[12] : 0;
    whole = whole && head[4] == w && head[5] == h && count >= start + row * h;
    for (size_t y = 0; y < h && whole; y++)
        for (size_t x = 0; x < w; x++)
            for (size_t c = 0; c < 3; c++)
                d->rgb[3 * (y * w + x) + c] = bytes[start + y * row + 4 * x + 2 - c];
    free(bytes);
    return whole;
}

int display_count(const struct display *d, uint32_t color, int left, int top, int right, int bottom)
{
    const int r = (int)(color >> 16 & 255), g = (int)(color >> 8 & 255), b = (int)(color & 255);
    int count = 0;
    for (int y = top; y < bottom; y++)
        for (int x = left; x < right; x++) {
            const uint8_t *p = d->rgb + 3 * (y * d->width + x);
            count += abs(p[0] - r) < 6 && abs(p[1] - g) < 6 && abs(p[2] - b) < 6;
        }
    return count;
}

int display_colors(const struct display *d, int left, int top, int right, int bottom)
{
    static bool seen[4096];
    int count = 0;
    memset(seen, 0, sizeof seen);
    for (int y = top; y < bottom; y++)
        for (int x = left; x < right; x++) {
            const uint8_t *p = d->rgb + 3 * (y * d->width + x);
            const int which = (p[0] >> 4) << 8 | (p[1] >> 4) << 4 | p[2] >> 4;
            count += !seen[which];
            seen[which] = true;
        }
    return count;
}

// ---------------------------------------------------------------- keyboard and pointer

static xcb_connection_t *connection(struct display *d)
{
    if (!d->connection)
        d->connection = xcb_connect(NULL, NULL);
    EXPECT_INT(xcb_connection_has_error(d->connection), 0);
    return d->connection;
}

static xcb_window_t root_of(struct display *d)
{
    return xcb_setup_roots_iterator(xcb_get_setup(connection(d))).data->root;
}

// XTEST's FakeInput (X Test Extension Protocol 2.2). libxcb-xtest has no more than this.
static void fake_input(struct display *d, uint8_t event, uint8_t detail, int x, int y)
{
    static xcb_extension_t xtest = {.name = "XTEST"};
    struct {
        uint8_t major, minor;
        uint16_t words;
        uint8_t event, detail, pad0[2];
        uint32_t delay_ms, root, pad1[2];
        int16_t x, y;
        uint8_t pad2[7], device;
    } request = {.event = event, .detail = detail, .root = root_of(d), .x = (int16_t)x, .y = (int16_t)y};
    _Static_assert(sizeof request == 36, "as the protocol has it");
    struct iovec parts[4] = {[2] = {.iov_base = &request, .iov_len = sizeof request}}; // libxcb uses the two before
    const xcb_protocol_request_t about = {.count = 1, .ext = &xtest, .opcode = 2, .isvoid = 1};
    const xcb_query_extension_reply_t *there = xcb_get_extension_data(connection(d), &xtest);
    EXPECT_TRUE(there && there->present);
    xcb_send_request(connection(d), 0, parts + 2, &about);
    xcb_flush(connection(d));
}

// Waits until the server has done all of it.
static void settle(struct display *d)
{
    free(xcb_get_input_focus_reply(connection(d), xcb_get_input_focus(connection(d)), NULL));
}

static uint8_t keycode_of(struct display *d, uint32_t keysym)
{
    const xcb_setup_t *setup = xcb_get_setup(connection(d));
    const int count = setup->max_keycode - setup->min_keycode + 1;
    xcb_get_keyboard_mapping_reply_t *reply = xcb_get_keyboard_mapping_reply(
        d->connection, xcb_get_keyboard_mapping(d->connection, setup->min_keycode, (uint8_t)count), NULL);
    EXPECT_TRUE(reply != NULL);
    const xcb_keysym_t *symbols = xcb_get_keyboard_mapping_keysyms(reply);
    int found = 0;
    for (int i = count - 1; i >= 0; i--)
        if (symbols[i * reply->keysyms_per_keycode] == keysym)
            found = setup->min_keycode + i;
    free(reply);
    EXPECT_TRUE(found > 0);
    return (uint8_t)found;
}

void display_key(struct display *d, uint32_t keysym)
{
    const uint8_t code = keycode_of(d, keysym);
    fake_input(d, XCB_KEY_PRESS, code, 0, 0);
    fake_input(d, XCB_KEY_RELEASE, code, 0, 0);
    settle(d);
}

void display_click(struct display *d, int x, int y)
{
    fake_input(d, XCB_MOTION_NOTIFY, 0, x, y);
    fake_input(d, XCB_BUTTON_PRESS, 1, 0, 0);
    fake_input(d, XCB_BUTTON_RELEASE, 1, 0, 0);
    fake_input(d, XCB_MOTION_NOTIFY, 0, d->width / 2, 1);
    settle(d);
}

void display_hold_key(struct display *d, uint32_t keysym, bool down)
{
    fake_input(d, down ? XCB_KEY_PRESS : XCB_KEY_RELEASE, keycode_of(d, keysym), 0, 0);
    settle(d);
}

void display_hold_button(struct display *d, int x, int y, bool down)
{
    fake_input(d, XCB_MOTION_NOTIFY, 0, x, y);
    fake_input(d, down ? XCB_BUTTON_PRESS : XCB_BUTTON_RELEASE, 1, 0, 0);
    settle(d);
}

static xcb_window_t topmost(struct display *d)
{
    xcb_query_tree_reply_t *tree = xcb_query_tree_reply(connection(d), xcb_query_tree(connection(d), root_of(d)), NULL);
    EXPECT_TRUE(tree != NULL && xcb_query_tree_children_length(tree) > 0);
    const xcb_window_t top = xcb_query_tree_children(tree)[xcb_query_tree_children_length(tree) - 1];
    free(tree);
    return top;
}

void display_focus(struct display *d, bool window)
{
    xcb_set_input_focus(connection(d), XCB_INPUT_FOCUS_NONE, window ? topmost(d) : (xcb_window_t)XCB_INPUT_FOCUS_NONE,
                        XCB_CURRENT_TIME);
    settle(d);
}

void display_grab_keyboard(struct display *d, bool grabbed)
{
    if (grabbed)
        free(xcb_grab_keyboard_reply(
            connection(d),
            xcb_grab_keyboard(connection(d), 1, root_of(d), XCB_CURRENT_TIME, XCB_GRAB_MODE_ASYNC, XCB_GRAB_MODE_ASYNC),
            NULL));
    else
        xcb_ungrab_keyboard(connection(d), XCB_CURRENT_TIME);
    settle(d);
}

void display_show_window(struct display *d, bool shown)
{
    if (shown)
        xcb_map_window(connection(d), topmost(d));
    else
        xcb_unmap_window(connection(d), topmost(d));
    settle(d);
}

static xcb_atom_t atom(struct display *d, const char *name)
{
    xcb_intern_atom_reply_t *reply =
        xcb_intern_atom_reply(connection(d), xcb_intern_atom(connection(d), 0, (uint16_t)strlen(name), name), NULL);
    EXPECT_TRUE(reply != NULL);
    const xcb_atom_t found = reply->atom;
    free(reply);
    return found;
}

void display_close_window(struct display *d)
{
    const xcb_window_t top = topmost(d);
    const xcb_client_message_event_t message = {.response_type = XCB_CLIENT_MESSAGE,
                                                .format = 32,
                                                .window = top,
                                                .type = atom(d, "WM_PROTOCOLS"),
                                                .data.data32 = {atom(d, "WM_DELETE_WINDOW"), XCB_CURRENT_TIME}};
    xcb_send_event(d->connection, 0, top, XCB_EVENT_MASK_NO_EVENT, (const char *)&message);
    settle(d);
}
