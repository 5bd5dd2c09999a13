(* The small gain behind guarantees, for itself: coqc small_gain.v. What is eliminated is 1 - M, with the bounds F on the right;
   positive pivots alone decide, as in proofs/checker/guarantee/bounds.py. *)

From Coq Require Import Reals List Lra Lia.
Import ListNotations.
Local Open Scope R_scope.

Fixpoint dot (a x : list R) : R :=
  match a, x with u :: a', v :: x' => u * v + dot a' x' | _, _ => 0 end.

(* q - s r *)
Fixpoint minus (q : list R) (s : R) (r : list R) : list R :=
  match q, r with u :: q', v :: r' => u - s * v :: minus q' s r' | _, _ => [] end.

(* Coefficients of an inequality, and its right side. *)
Definition row := (list R * R)%type.

Definition eliminated (p : R) (r : list R) (b : R) (one : row) : row :=
  match fst one with [] => one | a :: q => (minus q (a / p) r, snd one - a / p * b) end.

(* Gaussian elimination with positive pivots, and what it solves for. *)
Inductive solved : list row -> list R -> Prop :=
| nothing : solved [] []
| pivot p r b rows y : 0 < p -> solved (map (eliminated p r b) rows) y ->
    solved ((p :: r, b) :: rows) ((b - dot r y) / p :: y).

(* No coefficient beside the diagonal, which begins at k, is positive. *)
Fixpoint others (k : nat) (a : list R) : Prop :=
  match a, k with
  | [], _ => True
  | _ :: a', O => Forall (fun v => v <= 0) a'
  | u :: a', S k' => u <= 0 /\ others k' a'
  end.

Fixpoint beside (k : nat) (rows : list row) : Prop :=
  match rows with [] => True | one :: rest => others k (fst one) /\ beside (S k) rest end.

Definition holds (x : list R) (one : row) : Prop := length (fst one) = length x /\ dot (fst one) x <= snd one.

Lemma dot_minus q s r x : length q = length x -> length r = length x -> dot (minus q s r) x = dot q x - s * dot r x.
Proof.
  revert r x. induction q as [|u q ih]; intros [|v r] [|z x]; simpl; intros lq lr; try discriminate; [ring|].
  rewrite ih by congruence. ring.
Qed.

Lemma length_minus q s r : length q = length r -> length (minus q s r) = length q.
Proof. revert r. induction q as [|u q ih]; intros [|v r]; simpl; intros l; try discriminate; [reflexivity|]. rewrite ih; congruence. Qed.

Lemma dot_antitone r x y : Forall (fun v => v <= 0) r -> Forall2 Rle x y -> dot r y <= dot r x.
Proof.
  intros neg. revert x y. induction neg as [|v r hv neg ih]; intros x y le; [simpl; lra|].
  destruct le as [|s t x y st le]; simpl; [lra|]. specialize (ih _ _ le).
  assert (v * t <= v * s); [|lra]. apply Rmult_le_compat_neg_l; assumption.
Qed.

Lemma minus_nonpositive q s r : s <= 0 -> Forall (fun v => v <= 0) q -> Forall (fun v => v <= 0) r -> Forall (fun v => v <= 0) (minus q s r).
Proof.
  intros hs hq. revert r. induction hq as [|u q hu hq ih]; intros r hr; simpl; [constructor|].
  destruct hr as [|v r hv hr]; constructor; [|now apply ih]. assert (0 <= s * v); [|lra].
  replace (s * v) with (- s * - v) by ring. apply Rmult_le_pos; lra.
Qed.

Lemma others_minus k q s r : s <= 0 -> others k q -> Forall (fun v => v <= 0) r -> others k (minus q s r).
Proof.
  intros hs. revert k r. induction q as [|u q ih]; intros k r hq hr; [destruct k; exact I|].
  destruct hr as [|v r hv hr]; [destruct k; exact I|]. destruct k; simpl in *; [now apply minus_nonpositive|].
  destruct hq as [hu hq]. split; [|now apply ih]. assert (0 <= s * v); [|lra].
  replace (s * v) with (- s * - v) by ring. apply Rmult_le_pos; lra.
Qed.

Lemma quotient_nonpositive a p : 0 < p -> a <= 0 -> a / p <= 0.
Proof.
  intros hp ha. unfold Rdiv. assert (0 < / p) by now apply Rinv_0_lt_compat.
  assert (0 <= - a * / p); [apply Rmult_le_pos; lra|lra].
Qed.

Lemma beside_eliminated k p r b rows : 0 < p -> Forall (fun v => v <= 0) r -> beside (S k) rows -> beside k (map (eliminated p r b) rows).
Proof.
  intros hp hr. revert k. induction rows as [|[[|a q] c] rows ih]; intros k; simpl; [trivial| |]; intros [h rest]; split;
    try (now apply ih); [destruct k; exact I|].
  destruct h as [ha hq]. apply others_minus; auto. now apply quotient_nonpositive.
Qed.

Lemma holds_eliminated p r b x1 x one k :
  0 < p -> length r = length x -> p * x1 + dot r x <= b -> others (S k) (fst one) -> holds (x1 :: x) one ->
  holds x (eliminated p r b one).
Proof.
  destruct one as [[|a q] c]; unfold holds, eliminated; simpl; intros hp lr first oth [l h]; [discriminate|].
  destruct oth as [ha _]. injection l as l. split; [rewrite length_minus; congruence|].
  rewrite dot_minus by congruence. assert (hs := quotient_nonpositive a p hp ha).
  assert (- (a / p) * (p * x1 + dot r x) <= - (a / p) * b) by (apply Rmult_le_compat_l; lra).
  replace (- (a / p) * (p * x1 + dot r x)) with (- a * x1 - a / p * dot r x) in * by (field; lra). lra.
Qed.

Lemma all_eliminated p r b x1 x rows k :
  0 < p -> length r = length x -> p * x1 + dot r x <= b -> beside (S k) rows -> Forall (holds (x1 :: x)) rows ->
  Forall (holds x) (map (eliminated p r b) rows).
Proof.
  intros hp lr first. revert k. induction rows as [|one rows ih]; intros k bes all; simpl; constructor.
  - destruct bes as [h _]. inversion all; subst. now apply holds_eliminated with x1 k.
  - destruct bes as [_ h]. inversion all; subst. now apply ih with (S k).
Qed.

(* What satisfies the inequalities is below what elimination solves for. *)
Theorem below rows y : solved rows y -> forall x, length x = length rows -> Forall (holds x) rows -> beside 0 rows -> Forall2 Rle x y.
Proof.
  induction 1 as [|p r b rows y hp _ ih]; intros x lx all bes.
  - destruct x; [constructor|discriminate].
  - destruct x as [|x1 x]; [discriminate|]. inversion all as [|one rest [l h] allrest]; subst. simpl in *.
    destruct bes as [hr bes]. injection lx as lx. injection l as l.
    assert (le : Forall2 Rle x y).
    { apply ih; [rewrite map_length; exact lx| |now apply beside_eliminated]. now apply all_eliminated with x1 0%nat. }
    constructor; [|exact le]. assert (mono := dot_antitone r x y hr le).
    apply Rmult_le_reg_l with p; [exact hp|]. replace (p * ((b - dot r y) / p)) with (b - dot r y) by (field; lra). lra.
Qed.

(* A row of 1 - M from one of M, the diagonal at k. *)
Fixpoint one_minus (k : nat) (m : list R) : list R :=
  match m, k with [], _ => [] | u :: m', O => 1 - u :: map Ropp m' | u :: m', S k' => - u :: one_minus k' m' end.

Fixpoint system (k : nat) (gains : list row) : list row :=
  match gains with [] => [] | (m, f) :: rest => (one_minus k m, f) :: system (S k) rest end.

(* A signal is at most s until t. *)
Definition until (t : R) (w : R -> R) (s : R) : Prop := forall u, 0 <= u <= t -> Rabs (w u) <= s.

Lemma length_one_minus k m : length (one_minus k m) = length m.
Proof. revert k. induction m as [|u m ih]; intros [|k]; simpl; auto. now rewrite map_length. Qed.

Lemma dot_opp m x : dot (map Ropp m) x = - dot m x.
Proof. revert x. induction m as [|u m ih]; intros [|v x]; simpl; try ring. rewrite ih. ring. Qed.

Lemma dot_one_minus k m x : length m = length x -> (k < length x)%nat -> dot (one_minus k m) x = nth k x 0 - dot m x.
Proof.
  revert k x. induction m as [|u m ih]; intros k [|v x]; simpl; intros l lt; try discriminate; [inversion lt|].
  destruct k; simpl; [rewrite dot_opp; ring|]. rewrite ih; [ring|congruence|now apply PeanoNat.Nat.succ_lt_mono].
Qed.

Lemma nonpositive_opp m : Forall (fun v => 0 <= v) m -> Forall (fun v => v <= 0) (map Ropp m).
Proof. induction 1; simpl; constructor; [lra|assumption]. Qed.

Lemma others_one_minus k m : Forall (fun v => 0 <= v) m -> others k (one_minus k m).
Proof.
  intros pos. revert k. induction pos as [|u m hu pos ih]; intros [|k]; simpl; [exact I|exact I|now apply nonpositive_opp|].
  split; [lra|apply ih].
Qed.

Lemma beside_system k gains : Forall (fun g : row => Forall (fun v => 0 <= v) (fst g)) gains -> beside k (system k gains).
Proof.
  revert k. induction gains as [|[m f] gains ih]; intros k all; simpl; [exact I|]. inversion all; subst.
  split; [now apply others_one_minus|now apply ih].
Qed.

Lemma length_system k gains : length (system k gains) = length gains.
Proof. revert k. induction gains as [|[m f] gains ih]; intros k; simpl; auto. Qed.

Lemma holds_system pre x gains :
  Forall (fun g : row => length (fst g) = length (pre ++ x)) gains ->
  Forall2 (fun s (g : row) => s <= snd g + dot (fst g) (pre ++ x)) x gains ->
  Forall (holds (pre ++ x)) (system (length pre) gains).
Proof.
  revert pre gains. induction x as [|s x ih]; intros pre gains len le; inversion le as [|s' [m f] x' rest h le' e1 e2]; subst; simpl; [constructor|].
  inversion len as [|g gs l len']; subst. simpl in *. constructor.
  - unfold holds. simpl. rewrite length_one_minus. split; [exact l|].
    rewrite dot_one_minus; [|exact l|rewrite app_length; simpl; lia].
    rewrite app_nth2, PeanoNat.Nat.sub_diag by auto. simpl. lra.
  - replace (pre ++ s :: x) with ((pre ++ [s]) ++ x) in * by now rewrite <- app_assoc.
    replace (S (length pre)) with (length (pre ++ [s])) by (rewrite app_length; simpl; apply PeanoNat.Nat.add_1_r). now apply ih.
Qed.

Lemma same_length {A B : Type} (P : A -> B -> Prop) a b : Forall2 P a b -> length a = length b.
Proof. induction 1; simpl; congruence. Qed.

Lemma suprema t ws bound : 0 <= t -> Forall2 (until t) ws bound ->
  exists least, Forall2 (until t) ws least /\ Forall2 (fun w s => forall b, until t w b -> s <= b) ws least.
Proof.
  intros ht. induction 1 as [|w s ws bound h rest [least [up low]]]; [exists []; split; constructor|].
  destruct (completeness (fun v => exists u, 0 <= u <= t /\ v = Rabs (w u))) as [sup [above leastness]].
  - exists s. intros v [u [hu ->]]. now apply h.
  - exists (Rabs (w 0)). exists 0. split; [lra|reflexivity].
  - exists (sup :: least). split; constructor; try assumption.
    + intros u hu. apply above. now exists u.
    + intros b hb. apply leastness. intros v [u [hu ->]]. now apply hb.
Qed.

Lemma least_below t ws s whole gains :
  Forall2 (fun w s => forall b, until t w b -> s <= b) ws s ->
  Forall2 (fun w (g : row) => until t w (snd g + dot (fst g) whole)) ws gains ->
  Forall2 (fun s (g : row) => s <= snd g + dot (fst g) whole) s gains.
Proof. intros low. revert gains. induction low; intros gains all; inversion all; subst; constructor; auto. Qed.

(* Signals that are finite until every time, and causally bounded by F + M times the largest of them so far, are for ever
   below what the elimination of 1 - M with positive pivots makes of F. *)
Theorem small_gain ws gains y :
  Forall (fun g : row => length (fst g) = length ws /\ Forall (fun v => 0 <= v) (fst g)) gains ->
  (forall t, 0 <= t -> exists bound, Forall2 (until t) ws bound) ->
  (forall t bound, 0 <= t -> Forall2 (until t) ws bound ->
    Forall2 (fun w (g : row) => Rabs (w t) <= snd g + dot (fst g) bound) ws gains) ->
  solved (system 0 gains) y ->
  forall t, 0 <= t -> Forall2 (until t) ws y.
Proof.
  intros shape finite causal elim t ht. destruct (finite t ht) as [bound hb].
  destruct (suprema t ws bound ht hb) as [s [up low]].
  assert (ls : length ws = length s) by now apply same_length in up.
  assert (lg : length ws = length gains) by (specialize (causal t s ht up); now apply same_length in causal).
  assert (self : Forall2 (fun s' (g : row) => s' <= snd g + dot (fst g) s) s gains).
  { assert (all : Forall2 (fun w (g : row) => until t w (snd g + dot (fst g) s)) ws gains).
    { assert (each : forall u, 0 <= u <= t -> Forall2 (fun w (g : row) => Rabs (w u) <= snd g + dot (fst g) s) ws gains).
      { intros u hu. apply causal; [lra|]. clear - up hu. induction up; constructor; auto. intros z hz. apply H. lra. }
      clear - each lg. revert gains lg each. induction ws as [|w ws ih]; intros [|g gains] lg each; try discriminate; constructor.
      - intros u hu. specialize (each u hu). now inversion each.
      - apply ih; [now injection lg|]. intros u hu. specialize (each u hu). now inversion each. }
    now apply least_below with t ws. }
  assert (le : Forall2 Rle s y).
  { apply (below (system 0 gains)); [exact elim|rewrite length_system; congruence| |].
    - apply (holds_system [] s gains); [|exact self]. simpl. apply Forall_impl with (2 := shape). intros g [l _]. congruence.
    - apply beside_system. apply Forall_impl with (2 := shape). now intros g [_ p]. }
  clear - up le. revert y le. induction up as [|w s' ws s h up ih]; intros y le; inversion le; subst; constructor; auto.
  intros u hu. specialize (h u hu). lra.
Qed.

(* One signal with half of itself as gain. *)
Example halves : solved (system 0 [([/ 2], 1)]) [(1 - 0) / (1 - / 2)].
Proof. simpl. apply (pivot (1 - / 2) [] 1 [] []); [lra|constructor]. Qed.

Print Assumptions small_gain.
