"""The rotor: beam elements, discs, supports, rub, parameters, the GJ90C turbocharger."""
