/* What the FMI standards 2.0 and 3.0 call their types, in plain C: as much as this library needs of them. */
#ifndef FMI_H
#define FMI_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef unsigned Status;
enum { OK, WARNING, DISCARD, FAULT, FATAL };

/* importers pass NULL where they want no answer */
#define ANSWER(place, value) do { if (place) *(place) = (value); } while (0)

#ifdef OFFICIAL_HEADERS                /* the tests compile against them, to prove that all signatures agree */
#include "fmi2Functions.h"
#include "fmi3Functions.h"
typedef fmi2CallbackFunctions Callbacks;
typedef fmi2EventInfo EventInfo;
typedef fmi3LogMessageCallback LogMessage;
typedef fmi3IntermediateUpdateCallback IntermediateUpdate;
typedef fmi2Type Kind;
typedef fmi2StatusKind StatusKind;
typedef fmi3DependencyKind DependencyKind;
typedef fmi3IntervalQualifier IntervalQualifier;
#else
typedef struct {
    void (*logger)(void *environment, const char *name, Status status, const char *category, const char *message, ...);
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*finished)(void *environment, Status status);
    void *componentEnvironment;
} Callbacks;
typedef struct {
    int newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged, valuesOfContinuousStatesChanged;
    int nextEventTimeDefined;
    double nextEventTime;
} EventInfo;
typedef void (*LogMessage)(void *environment, Status status, const char *category, const char *message);
typedef void (*IntermediateUpdate)(void *environment, double time, bool set_requested, bool get_allowed, bool finished,
                                   bool can_return_early, bool *early_return, double *early_time);
typedef unsigned Kind, StatusKind, DependencyKind, IntervalQualifier;
#endif

#endif
