/* Numbers of contacts that FMUs have in common with what assembles them and what joins them: contact_limits.py reads them. */
#ifndef LIAISONS_CONTACT_LIMITS_H
#define LIAISONS_CONTACT_LIMITS_H

enum { MOST_CONTACTS = 64 };  /* of one FMU */
enum { MOST_IMPACTS = 1000 }; /* at one instant */

/* Velocity that is rounding, in parts of the sizes of its terms. */
static const double STILL = 2e-12;
/* Energy that an impact may gain by rounding, in parts of what its impulses exchange. */
static const double ENERGY_GAIN = 1e-9;

#endif
