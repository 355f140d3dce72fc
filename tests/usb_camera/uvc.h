// The descriptors and payload format of a USB camera (USB Video Class 1.0): one format, one
// size, one rate, a bulk endpoint.
#pragma once
#include "tests/usb_camera/usbip.h"

enum uvc_format { UVC_MJPEG, UVC_YUYV };
enum { UVC_PAYLOAD_BYTES = 16384, UVC_ENDPOINT = 1 }; // a payload has the size of the kernel's requests

struct uvc_camera {
    enum uvc_format format;
    int width, height;
    int frame_ns;       // from one image to the next
    bool bt709;         // the matrix of its YUYV; otherwise BT.601
    bool committed;     // the host has set the format: images may be sent
    uint8_t chosen[26]; // the host's last probe or commit
};

// Answers a control request. False: the host disconnected.
bool uvc_control(struct uvc_camera *camera, int socket, const struct usb_request *request);

// One payload of an image: its header, and as much of `image` from *at on as fits; advances *at. frame_id: alternates
// with every image. Returns the payload's bytes.
int uvc_payload(const uint8_t *image, size_t count, size_t *at, bool frame_id, uint8_t out[UVC_PAYLOAD_BYTES]);
