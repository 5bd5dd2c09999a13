(* The comparison step behind settling times, for itself: coqc comparison.v. Along a Filippov solution V is absolutely continuous;
   here it is differentiable, so that what is left to words is the step from one to the other. *)

From Coq Require Import Reals Lra.
Local Open Scope R_scope.

(* A quantity that falls at least as fast as -kappa v^a, a < 1, cannot stay positive beyond v(0)^(1 - a) / ((1 - a) kappa). *)
Theorem finite_time v dv kappa a T :
  0 < kappa -> a < 1 -> 0 < T ->
  (forall t, 0 <= t <= T -> 0 < v t) ->
  (forall t, 0 <= t <= T -> derivable_pt_lim v t (dv t)) ->
  (forall t, 0 <= t <= T -> dv t <= - kappa * Rpower (v t) a) ->
  T < Rpower (v 0) (1 - a) / ((1 - a) * kappa).
Proof.
  intros pk la pT pos der fall. set (w := fun t => Rpower (v t) (1 - a)).
  set (dw := fun t => (1 - a) * Rpower (v t) (1 - a - 1) * dv t).
  assert (derw : forall t, 0 <= t <= T -> derivable_pt_lim w t (dw t)).
  { intros t ht. apply (derivable_pt_lim_comp v (fun s => Rpower s (1 - a))); [now apply der |].
    apply derivable_pt_lim_power. now apply pos. }
  destruct (MVT_cor2 w dw 0 T pT) as [c [eq hc]]; [intros; now apply derw |].
  assert (slope : dw c <= - ((1 - a) * kappa)).
  { unfold dw. assert (0 <= c <= T) as ic by lra. specialize (fall c ic). specialize (pos c ic).
    assert (one : Rpower (v c) (1 - a - 1) * Rpower (v c) a = 1).
    { rewrite <- Rpower_plus. replace (1 - a - 1 + a) with 0 by ring. now apply Rpower_O. }
    assert (pp : 0 < Rpower (v c) (1 - a - 1)) by apply exp_pos.
    apply Rle_trans with ((1 - a) * Rpower (v c) (1 - a - 1) * (- kappa * Rpower (v c) a)).
    - apply Rmult_le_compat_l; [apply Rmult_le_pos; lra | exact fall].
    - replace ((1 - a) * Rpower (v c) (1 - a - 1) * (- kappa * Rpower (v c) a))
        with (- ((1 - a) * kappa) * (Rpower (v c) (1 - a - 1) * Rpower (v c) a)) by ring. rewrite one. lra. }
  assert (wT : 0 < w T) by apply exp_pos. assert (pak : 0 < (1 - a) * kappa) by (apply Rmult_lt_0_compat; lra).
  apply Rmult_lt_reg_r with ((1 - a) * kappa); [exact pak |].
  unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. rewrite Rmult_1_r. change (Rpower (v 0) (1 - a)) with (w 0).
  assert (bound : dw c * (T - 0) <= - ((1 - a) * kappa) * (T - 0)) by (apply Rmult_le_compat_r; lra). lra.
Qed.
Print Assumptions finite_time.
