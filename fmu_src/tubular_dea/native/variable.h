/* What the generated variable table says of each FMI variable. */
#ifndef VARIABLE_H
#define VARIABLE_H

typedef enum { TIME, INPUT, OUTPUT, STATE, DERIVATIVE, PARAMETER, FOLD } Kind;
typedef enum { TYPE_REAL, TYPE_INTEGER, TYPE_BOOLEAN } Type;
typedef enum { CONTINUOUS, DISCRETE, TUNABLE, FIXED } Variability;

/* The value reference of a variable is its place in `model_variables`. */
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

extern const Variable model_variables[];
extern const double model_nominal[];

#endif
