// What a USB camera says of itself and how it wraps its pictures (USB Video Class 1.0,
// one format, one size, one rate, a bulk endpoint).
#pragma once
#include "tests/usb_camera/usbip.h"

enum uvc_format { UVC_MJPEG, UVC_YUYV };
enum { UVC_PAYLOAD_BYTES = 16384, UVC_ENDPOINT = 1 }; // a payload fills the kernel's request exactly

struct uvc_camera {
    enum uvc_format format;
    int width, height;
    int frame_ns;       // from one picture to the next
    bool bt709;         // the matrix of its YUYV; else BT.601
    bool committed;     // the host has chosen: pictures may flow
    uint8_t chosen[26]; // as the host last set it
};

// Answers a control request. False: the host is gone.
bool uvc_control(struct uvc_camera *camera, int socket, const struct usb_request *request);

// One payload of the picture: its header, and as much of `picture` from *at on as fits; moves
// *at on. odd: changes with every picture. Returns the payload's bytes.
int uvc_payload(const uint8_t *picture, size_t count, size_t *at, bool odd, uint8_t out[UVC_PAYLOAD_BYTES]);
