// The commands of both programs, each in the file of its name (verify with repair). Each parses its arguments and
// returns the exit code.
#pragma once
#include "app/commands/command.h"

int capture_devices(int argc, char **argv);
int capture_map(int argc, char **argv);
int capture_record(int argc, char **argv);
int capture_info(int argc, char **argv);
int capture_verify(int argc, char **argv);
int capture_repair(int argc, char **argv);
int capture_export(int argc, char **argv);
int capture_tags(int argc, char **argv);
int capture_studio(int argc, char **argv);
int capture_take(int argc, char **argv);
int capture_library(int argc, char **argv);
int capture_angles(int argc, char **argv);
int capture_calibrate(int argc, char **argv);
int capture_models(int argc, char **argv);
int capture_objects(int argc, char **argv);

int reenact_render(int argc, char **argv);
int reenact_compare(int argc, char **argv);
int reenact_locate(int argc, char **argv);
int reenact_drive(int argc, char **argv);
int reenact_surround(int argc, char **argv);
int reenact_watch(int argc, char **argv);
