// The device's end of USB/IP (Documentation/usb/usbip_protocol.rst): the kernel's
// virtual host controller, vhci-hcd, sends requests through a socket; this process
// is the device and answers them. There is no server and no network.
#pragma once
#include "base/status.h"

enum { USB_MAX_BYTES = 65536 };

struct usb_request {
    uint32_t number;             // identifies the request in the answer
    bool in;                     // the host wants data
    int endpoint;                // 0: control
    uint8_t setup[8];            // of a control request
    int length;                  // bytes that the host accepts, or sends
    uint8_t data[USB_MAX_BYTES]; // those that it sends
};

enum usb_event {
    USB_REQUEST,   // *request is filled; answer it with usbip_answer
    USB_CANCELLED, // the host cancels the request `number`; `length` is the cancel_number for usbip_cancelled
    USB_GONE,      // the host disconnected
    USB_QUIET,     // nothing within wait_ms
};

// Plugs a high-speed device into the first free port of vhci-hcd and returns the
// socket's end in *socket. ERR_DEVICE: no vhci-hcd, or it refuses; ERR_IO.
MUST_CHECK enum status usbip_plug(int *socket);

enum usb_event usbip_receive(int socket, int wait_ms, struct usb_request *request);

// status: 0, or -EPIPE for an unsupported request. count: bytes sent or received. False: the host disconnected.
bool usbip_answer(int socket, const struct usb_request *request, int status, const void *data, int count);
bool usbip_cancelled(int socket, uint32_t cancel_number, bool was_waiting);
