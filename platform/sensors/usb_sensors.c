#include "platform/sensors/usb_sensors.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { ANY = 0xffff }; // product

// By the ids in the makers' drivers (OpenNI2, libfreenect, libfreenect2, librealsense, k4a, depthai). Only the part
// that has the camera, of sensors that are several devices.
struct known_sensor {
    uint16_t vendor, product;
    bool by_openni; // a driver of Debian's OpenNI2 opens it
    const char *name, *needs;
};

static const char freenect[] = "libfreenect's driver for OpenNI2, built from its source, in OpenNI2/Drivers";
static const char orbbec[] =
    "for a first Astra Orbbec's driver for OpenNI2 (liborbbec) in OpenNI2/Drivers; later ones (Astra 2, Gemini, Femto) "
    "speak the maker's SDK alone, which these programs do not use";
static const char realsense[] =
    "the kernel's driver uvcvideo, with which it is v4l2:N, and the right to open its /dev/video (group video); or "
    "librealsense's driver for OpenNI2 (built with BUILD_OPENNI2_BINDINGS) in OpenNI2/Drivers";
static const char oak[] = "the maker's depthai, which these programs do not use";
static const char telephone[] = "to be filmed with: with Record3D or Stray Scanner, if it has a LiDAR sensor; copy the "
                                "film here and give it as r3d:FILE or stray:DIR";

static const struct known_sensor known[] = {
    {0x03e7, 0x2485, false, "OAK (Luxonis)", oak},
    {0x03e7, 0xf63b, false, "OAK (Luxonis)", oak},
    {0x045e, 0x02ae, false, "Kinect for Xbox 360 (v1)", freenect},
    {0x045e, 0x02bf, false, "Kinect for Windows (v1)", freenect},
    {0x045e, 0x02c4, false, "Kinect for Windows (v2)",
     "a USB 3 port and libfreenect2's driver for OpenNI2 in OpenNI2/Drivers"},
    {0x045e, 0x02d8, false, "Kinect for Xbox One (v2)",
     "a USB 3 port and libfreenect2's driver for OpenNI2 in OpenNI2/Drivers"},
    {0x045e, 0x097c, false, "Azure Kinect", "its SDK: record with k4arecorder and give the film as mkv:FILE"},
    {0x05ac, 0x12a8, false, "iPhone", telephone},
    {0x05ac, 0x12ab, false, "iPad", telephone},
    {0x1d27, ANY, true, "PrimeSense Carmine, ASUS Xtion or Structure Sensor",
     "a USB 2 port of its own, and no other program that uses it"},
    {0x2b03, ANY, false, "ZED (Stereolabs)",
     "the maker's closed SDK and an NVIDIA card, which these programs do not use"},
    {0x2bc5, ANY, false, "Orbbec camera", orbbec},
    {0x8086, 0x0a66, false, "RealSense F200", realsense},
    {0x8086, 0x0a80, false, "RealSense R200", realsense},
    {0x8086, 0x0aa5, false, "RealSense SR300", realsense},
    {0x8086, 0x0ad1, false, "RealSense D400", realsense},
    {0x8086, 0x0ad2, false, "RealSense D410", realsense},
    {0x8086, 0x0ad3, false, "RealSense D415", realsense},
    {0x8086, 0x0ad4, false, "RealSense D430", realsense},
    {0x8086, 0x0af6, false, "RealSense D420", realsense},
    {0x8086, 0x0b07, false, "RealSense D435", realsense},
    {0x8086, 0x0b3a, false, "RealSense D435i", realsense},
    {0x8086, 0x0b5b, false, "RealSense D405", realsense},
    {0x8086, 0x0b5c, false, "RealSense D455", realsense},
    {0x8086, 0x0b64, false, "RealSense L515", realsense},
    {0x8086, 0xabcd, false, "RealSense D457", realsense},
};

static const struct known_sensor *find_known(unsigned vendor, unsigned product)
{
    for (size_t i = 0; i < COUNT_OF(known); i++)
        if (known[i].vendor == vendor && (known[i].product == product || known[i].product == ANY))
            return &known[i];
    return NULL;
}

// A number that the kernel states in a file of the device. False: there is none, as of an interface.
static bool read_number(const char *devices, const char *device, const char *name, int base, unsigned *out)
{
    char path[600], text[16] = "", *end;
    if (snprintf(path, sizeof path, "%s/%s/%s", devices, device, name) >= (int)sizeof path)
        return false;
    FILE *file = fopen(path, "r");
    if (!file)
        return false;
    const bool read = fgets(text, sizeof text, file) != NULL;
    fclose(file);
    const unsigned long number = strtoul(text, &end, base);
    *out = (unsigned)number;
    return read && end != text && number <= 0xffff;
}

// Whether this user may not open the device's node.
static bool is_forbidden(const char *devices, const char *nodes, const char *device)
{
    char path[600];
    unsigned bus, number;
    if (!read_number(devices, device, "busnum", 10, &bus) || !read_number(devices, device, "devnum", 10, &number))
        return false;
    snprintf(path, sizeof path, "%s/%03u/%03u", nodes, bus, number);
    return faccessat(AT_FDCWD, path, R_OK | W_OK, AT_EACCESS) && errno == EACCES;
}

static int compare_sensors(const void *a, const void *b)
{
    const struct usb_sensor *x = a, *y = b;
    const int by_vendor = (x->vendor > y->vendor) - (x->vendor < y->vendor);
    return by_vendor ? by_vendor : (x->product > y->product) - (x->product < y->product);
}

enum status usb_sensors_find(const char *devices, const char *nodes, struct usb_sensor *out, int capacity, int *count)
{
    *count = 0;
    DIR *folder = opendir(devices);
    if (!folder)
        return errno == ENOMEM ? fail(ERR_MEMORY, "no memory to look for sensors") : OK;
    for (const struct dirent *entry; (entry = readdir(folder));) {
        unsigned vendor, product;
        if (*entry->d_name == '.' || !read_number(devices, entry->d_name, "idVendor", 16, &vendor) ||
            !read_number(devices, entry->d_name, "idProduct", 16, &product))
            continue;
        const struct known_sensor *sensor = find_known(vendor, product);
        if (!sensor)
            continue;
        if (*count < capacity) {
            const bool forbidden = sensor->by_openni && is_forbidden(devices, nodes, entry->d_name);
            out[*count] = (struct usb_sensor){
                (uint16_t)vendor, (uint16_t)product, sensor->name,
                forbidden ? "the right to open it: see the section about rights" : sensor->needs, forbidden};
        }
        ++*count;
    }
    closedir(folder);
    qsort(out, (size_t)(*count < capacity ? *count : capacity), sizeof *out, compare_sensors);
    return OK;
}
