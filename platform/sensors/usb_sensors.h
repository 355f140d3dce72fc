// Which depth sensors are plugged in, by their USB ids, whether or not a driver here can open them; and what each
// needs. For who sees a sensor in lsusb and not in `reenact-capture devices`.
#pragma once
#include "base/status.h"

#include <stdint.h>

struct usb_sensor {
    uint16_t vendor, product;
    const char *name;  // "Kinect for Xbox One (v2)"
    const char *needs; // goes on after "it needs": without a full stop
    bool forbidden;    // one that OpenNI2 would open, but whose device this user may not open; `needs` is then that
};

// Where the kernel lists them.
#define USB_DEVICES "/sys/bus/usb/devices"
#define USB_NODES   "/dev/bus/usb"

// Fills at most `capacity`, by vendor and product; *count: how many there are. devices and nodes: USB_DEVICES and
// USB_NODES, or a test's own. No such folder is OK with 0. ERR_MEMORY.
MUST_CHECK enum status usb_sensors_find(const char *devices, const char *nodes, struct usb_sensor *out, int capacity,
                                        int *count);
