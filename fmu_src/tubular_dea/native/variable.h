/* What the generated variable table says of each FMI variable. */
#ifndef VARIABLE_H
#define VARIABLE_H

typedef enum { TIME, INPUT, OUTPUT, STATE, DERIVATIVE, PARAMETER, FOLD, SAMPLED } Kind;
typedef enum { TYPE_REAL, TYPE_INTEGER, TYPE_BOOLEAN } Type;
typedef enum { CONTINUOUS, DISCRETE, TUNABLE, FIXED } Variability;

typedef struct {
    const char *name;
    const char *unit;
    Kind kind;
    int index; /* place in the array of its kind */
    Type type;
    Variability variability;
    double minimum, maximum, start;
    int needs_fold; /* its value needs the fold of the equilibrium curve */
} Variable;

/* A delayed signal: its place among the inputs, and the input or output that it delays by a parameter (the other is -1). */
typedef struct {
    int slot, input, output, parameter;
    double maximum; /* of the delay in s */
    double nominal; /* typical size of the signal */
} DelayLine;

extern const DelayLine model_delays[];
extern const Variable model_variables[];
extern const double model_nominal[];

#endif
