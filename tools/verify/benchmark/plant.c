/* The nominal plant in plain C, as one would write it by hand: Euler angles, M as a full 6 x 6, a general LDL' solver,
   Runge-Kutta of fourth order. What the compiled kernels are timed against (`glider benchmark --only plant`).

   cc -O3 -march=native plant.c -lm -o plant && ./plant STEPS
   prints steps per second, then the final state: X Y Z phi theta psi, u v w p q r, servo slider ballast. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { STATES = 15 };

/* The shipped vehicle, SI. */
static const double G = 9.80665, M_T = 13.0, M_R = 2.0, M_S = 2.0;
static const double X_R = 0.0, R_R = 0.015, R_SX0 = 0.0, R_S = 0.02, X_B = 0.35;
static const double HULL[3] = {0.04 + 0.02, 1.5 + 1.1, 1.5 + 1.0}, ADDED[3] = {0.3, 10.0, 12.0};
static const double K_D0 = 3.0, K_D = 45.0, K_L0 = 0.0, K_L = 120.0, K_BETA = -20.0;
static const double K_MR = -1.5, K_P = -2.0, K_M0 = 0.0, K_M = -17.0, K_Q = -8.0, K_MY = 26.0, K_R = -5.0;
static const double RANGE[3] = {1.0472, 0.06, 0.2}, RATE[3] = {1.0, 0.02, 0.03}, TAU[3] = {0.1, 0.15, 0.3};

static inline double limit(double value, double size) { return value > size ? size : value < -size ? -size : value; }

/* out += a x b */
static inline void add_cross(double *out, const double *a, const double *b) {
  out[0] += a[1] * b[2] - a[2] * b[1];
  out[1] += a[2] * b[0] - a[0] * b[2];
  out[2] += a[0] * b[1] - a[1] * b[0];
}

/* Adds a point mass to the lower right block of M. */
static inline void add_inertia(double M[6][6], double m, const double *r) {
  double rr = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j <= i; j++) M[3 + i][3 + j] += m * ((i == j ? rr : 0.0) - r[i] * r[j]);
}

/* Solves M x = f in place of f; reads and overwrites the lower triangle of M. */
static inline void solve(double M[6][6], double *f) {
  double inverse[6];
  for (int j = 0; j < 6; j++) {
    double scaled[6] = {0.0};
    for (int k = 0; k < j; k++) {
      scaled[k] = M[j][k] * M[k][k];
      M[j][j] -= M[j][k] * scaled[k];
    }
    inverse[j] = 1.0 / M[j][j];
    for (int i = j + 1; i < 6; i++) {
      for (int k = 0; k < j; k++) M[i][j] -= M[i][k] * scaled[k];
      M[i][j] *= inverse[j];
    }
  }
  for (int i = 1; i < 6; i++)
    for (int k = 0; k < i; k++) f[i] -= M[i][k] * f[k];
  for (int i = 0; i < 6; i++) f[i] *= inverse[i];
  for (int i = 4; i >= 0; i--)
    for (int k = i + 1; k < 6; k++) f[i] -= M[k][i] * f[k];
}

static void derivative(const double *x, const double *command, double *dx) {
  const double *V = x + 6, *omega = x + 9, *act = x + 12;
  double *f = dx + 6, *speed = dx + 12; /* f: first the forces, then nu_dot */
  for (int i = 0; i < 3; i++) speed[i] = limit((limit(command[i], RANGE[i]) - act[i]) / TAU[i], RATE[i]);
  double sf = sin(x[3]), cf = cos(x[3]), st = sin(x[4]), ct = cos(x[4]), sp = sin(x[5]), cp = cos(x[5]);
  double sg = sin(act[0]), cg = cos(act[0]), ballast = act[2];

  /* Mass: first moment S, its rate, M (lower triangle), momenta P and Q. */
  double sr = M_R * R_R + M_S * R_S;
  double S[3] = {M_S * act[1] + ballast * X_B, sr * sg, sr * cg};
  double dS[3] = {M_S * speed[1] + speed[2] * X_B, sr * cg * speed[0], -sr * sg * speed[0]};
  double rail[3] = {X_R, R_R * sg, R_R * cg}, sliding[3] = {R_SX0 + act[1], R_S * sg, R_S * cg};
  double tank[3] = {X_B, 0.0, 0.0};
  double M[6][6] = {{0.0}};
  for (int i = 0; i < 3; i++) {
    M[i][i] = M_T + ballast + ADDED[i];
    M[3 + i][3 + i] = HULL[i];
  }
  M[3][1] = -S[2], M[3][2] = S[1], M[4][0] = S[2], M[4][2] = -S[0], M[5][0] = -S[1], M[5][1] = S[0];
  add_inertia(M, M_R, rail);
  add_inertia(M, M_S, sliding);
  add_inertia(M, ballast, tank);
  double PQ[6];
  for (int i = 0; i < 6; i++) {
    PQ[i] = 0.0;
    for (int j = 0; j < 6; j++) PQ[i] += (i < j ? M[j][i] : M[i][j]) * x[6 + j];
  }

  /* Water: flow angles, forces and moments in flow axes, then in body axes. */
  double V2 = V[0] * V[0] + V[1] * V[1] + V[2] * V[2], size = sqrt(V2);
  double alpha = size < 1e-6 ? 0.0 : atan2(V[2], V[0]), beta = size < 1e-6 ? 0.0 : asin(limit(V[1] / size, 1.0));
  double ca = cos(alpha), sa = sin(alpha), cb = cos(beta), sb = sin(beta);
  double wrench[6] = {-(K_D0 + K_D * alpha * alpha), K_BETA * beta, -(K_L0 + K_L * alpha),
                      K_MR * beta + K_P * omega[0], K_M0 + K_M * alpha + K_Q * omega[1], K_MY * beta + K_R * omega[2]};
  for (int i = 0; i < 6; i += 3) {
    const double *a = wrench + i;
    f[i] = V2 * (ca * cb * a[0] - ca * sb * a[1] - sa * a[2]);
    f[i + 1] = V2 * (sb * a[0] + cb * a[1]);
    f[i + 2] = V2 * (sa * cb * a[0] - sa * sb * a[1] + ca * a[2]);
  }

  /* Weight, turning axes, M_dot nu. */
  double down[3] = {-st, sf * ct, cf * ct}, gS[3] = {G * S[0], G * S[1], G * S[2]};
  double minus_dS[3] = {-dS[0], -dS[1], -dS[2]};
  for (int i = 0; i < 3; i++) f[i] += ballast * G * down[i] - speed[2] * V[i];
  add_cross(f, PQ, omega);
  add_cross(f, dS, omega);
  add_cross(f + 3, PQ + 3, omega);
  add_cross(f + 3, PQ, V);
  add_cross(f + 3, gS, down);
  add_cross(f + 3, minus_dS, V);
  solve(M, f);

  dx[0] = ct * cp * V[0] + (sf * st * cp - cf * sp) * V[1] + (cf * st * cp + sf * sp) * V[2];
  dx[1] = ct * sp * V[0] + (cf * cp + sf * st * sp) * V[1] + (cf * st * sp - sf * cp) * V[2];
  dx[2] = down[0] * V[0] + down[1] * V[1] + down[2] * V[2];
  double turn = (sf * omega[1] + cf * omega[2]) / ct;
  dx[3] = omega[0] + st * turn;
  dx[4] = cf * omega[1] - sf * omega[2];
  dx[5] = turn;
}

static void step(double *x, const double *command, double h) {
  double k1[STATES], k2[STATES], k3[STATES], k4[STATES], y[STATES];
  derivative(x, command, k1);
  for (int i = 0; i < STATES; i++) y[i] = x[i] + 0.5 * h * k1[i];
  derivative(y, command, k2);
  for (int i = 0; i < STATES; i++) y[i] = x[i] + 0.5 * h * k2[i];
  derivative(y, command, k3);
  for (int i = 0; i < STATES; i++) y[i] = x[i] + h * k3[i];
  derivative(y, command, k4);
  for (int i = 0; i < STATES; i++) x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
}

int main(int argc, char **argv) {
  long steps = argc > 1 ? atol(argv[1]) : 2000000;
  const double command[3] = {0.6, -0.02, 0.1};
  double x[STATES] = {0.0};
  x[2] = 1.0, x[6] = 0.2;
  struct timespec begin, end;
  clock_gettime(CLOCK_MONOTONIC, &begin);
  for (long i = 0; i < steps; i++) step(x, command, 0.01);
  clock_gettime(CLOCK_MONOTONIC, &end);
  printf("%.0f\n", steps / ((double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec)));
  for (int i = 0; i < STATES; i++) printf("%.12g%c", x[i], i < STATES - 1 ? ' ' : '\n');
  return 0;
}
