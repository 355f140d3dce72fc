// usbip.h over a socket pair with vhci-hcd.
#include "tests/usb_camera/usbip.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { CMD_SUBMIT = 1, CMD_UNLINK = 2, RET_SUBMIT = 3, RET_UNLINK = 4 };
enum { HIGH_SPEED = 3, DEVICE_ID = 1 << 16 | 2, HEADER_BYTES = 48 };

static const char folder[] = "/sys/devices/platform/vhci_hcd.0";

// The number of a free high-speed port; -1: none.
static int free_port(void)
{
    char path[128], line[256];
    snprintf(path, sizeof path, "%s/status", folder);
    FILE *file = fopen(path, "r");
    int port = -1, number, state;
    while (file && port < 0 && fgets(line, sizeof line, file))
        if (sscanf(line, "hs %d %d", &number, &state) == 2 && state == 4) // VDEV_ST_NULL
            port = number;
    if (file)
        fclose(file);
    return port;
}

enum status usbip_plug(int *out)
{
    int ends[2], port = free_port();
    char path[128], line[64];
    if (port < 0)
        return fail(ERR_DEVICE, "%s has no free port; is the module vhci-hcd loaded?", folder);
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends))
        return fail(ERR_IO, "no socket: %s", strerror(errno));
    snprintf(path, sizeof path, "%s/attach", folder);
    int count = snprintf(line, sizeof line, "%d %d %u %d", port, ends[1], DEVICE_ID, HIGH_SPEED);
    int file = open(path, O_WRONLY);
    bool good = file >= 0 && write(file, line, (size_t)count) == count;
    int error = errno;
    if (file >= 0)
        close(file);
    close(ends[1]); // the kernel holds its own reference
    if (!good) {
        close(ends[0]);
        return fail(ERR_DEVICE, "%s cannot be written (%s); are you root?", path, strerror(error));
    }
    *out = ends[0];
    return OK;
}

static bool read_all(int socket, void *bytes, size_t count)
{
    for (size_t got = 0; got < count;) {
        ssize_t n = read(socket, (char *)bytes + got, count - got);
        if (n <= 0)
            return false;
        got += (size_t)n;
    }
    return true;
}

static bool write_all(int socket, const void *bytes, size_t count)
{
    for (size_t put = 0; put < count;) {
        ssize_t n = send(socket, (const char *)bytes + put, count - put, MSG_NOSIGNAL);
        if (n <= 0)
            return false;
        put += (size_t)n;
    }
    return true;
}

enum usb_event usbip_receive(int socket, int wait_ms, struct usb_request *r)
{
    struct pollfd ready = {socket, POLLIN, 0};
    uint32_t head[HEADER_BYTES / 4];
    if (poll(&ready, 1, wait_ms) <= 0)
        return USB_QUIET;
    if (!read_all(socket, head, sizeof head))
        return USB_GONE;
    // command, number, device, direction, endpoint, then the command's own fields
    r->in = ntohl(head[3]);
    r->endpoint = (int)ntohl(head[4]);
    if (ntohl(head[0]) == CMD_UNLINK) {
        r->number = ntohl(head[5]);      // of the request to cancel
        r->length = (int)ntohl(head[1]); // the number of this command, for usbip_cancelled
        return USB_CANCELLED;
    }
    r->number = ntohl(head[1]);
    r->length = (int)ntohl(head[6]);
    memcpy(r->setup, &head[10], sizeof r->setup);
    if (r->length < 0 || r->length > USB_MAX_BYTES)
        return USB_GONE;
    return r->in || read_all(socket, r->data, (size_t)r->length) ? USB_REQUEST : USB_GONE;
}

bool usbip_answer(int socket, const struct usb_request *r, int status, const void *data, int count)
{
    const uint32_t head[HEADER_BYTES / 4] = {htonl(RET_SUBMIT),       htonl(r->number),      0, 0, 0,
                                             htonl((uint32_t)status), htonl((uint32_t)count)};
    return write_all(socket, head, sizeof head) && (!r->in || count == 0 || write_all(socket, data, (size_t)count));
}

bool usbip_cancelled(int socket, uint32_t cancel_number, bool was_waiting)
{
    const int status = was_waiting ? -ECONNRESET : 0;
    const uint32_t head[HEADER_BYTES / 4] = {htonl(RET_UNLINK), htonl(cancel_number), 0, 0, 0, htonl((uint32_t)status)};
    return write_all(socket, head, sizeof head);
}
