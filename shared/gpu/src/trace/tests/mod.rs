mod footprint;
