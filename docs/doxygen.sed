# Plain comments as doxygen wants them; the sources stay as they are.
# the head of a file
1s,^/\*$,/** @file,
# between parts of a header: no comment of anything
/^\/\* ----.*\*\/$/d
s,^/\* ----.*,/*,
# before a declaration
s,^/\* ,/** ,
s,^    /\* ,    /** ,
# behind one
s,^([^/]*[^/ *][^/]*[;\,{] *)/\* ,\1/**< ,
s,^( +[A-Z][A-Z_0-9]+( = [^/]*)?) +/\* ,\1 /**< ,
