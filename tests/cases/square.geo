// A unit square of 2 x 2 quadrilaterals; all four sides and the surface are named.
Point(1) = {0, 0, 0, 0.5};
Point(2) = {1, 0, 0, 0.5};
Point(3) = {1, 1, 0, 0.5};
Point(4) = {0, 1, 0, 0.5};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Transfinite Curve {1, 2, 3, 4} = 3;
Plane Surface(1) = {1};
Physical Curve("bottom") = {1};
Physical Curve("left") = {4};
Physical Curve("right") = {2};
Physical Curve("top") = {3};
Recombine Surface {1};
Transfinite Surface {1};
Physical Surface("soil") = {1};
